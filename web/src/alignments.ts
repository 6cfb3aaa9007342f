// Frames of robots' own and where they lie on the level, as the card of them knows it. Pure.

import type { Alignment, AlignmentCandidate, AlignmentDoubt, UnalignedFrame, UncertainPose } from "./wire";
import { ago, coordinate, counted, degrees, lengthInWords, listed } from "./words";

export interface AlignmentsState {
  open: boolean;
  /** Frames of which contributions are held; null until they are known. */
  unaligned: readonly UnalignedFrame[] | null;
  /** Alignments in the log, newest first. */
  alignments: readonly Alignment[];
  /** The frame that an answer is on its way for. */
  answering: string | null;
  problem: string | null;
  /** What was done last, in words. */
  done: string | null;
}

/** Before the card is opened. */
export const NO_ALIGNMENTS: AlignmentsState = { open: false, unaligned: null, alignments: [], answering: null, problem: null, done: null };

const DOUBT_WORDS: Readonly<Record<AlignmentDoubt, string>> = {
  little_overlap: "the maps share too little wall",
  conflict: "walls of one are free in the other",
  few_landmarks: "they share too few landmarks",
  loose: "a direction is left open, as along a corridor",
  runner_up: "another place fits nearly as well",
};

/** A frame, for people: the beginning of its id. */
export function frameInWords(frame: string): string {
  return `Frame ${frame.slice(0, 8)}`;
}

/** Who waits with what. */
export function heldInWords({ robots, contributions, frame }: UnalignedFrame): string {
  const who = robots.length === 0 ? "nobody" : listed(robots);
  return `${frameInWords(frame)}: ${counted(contributions, "contribution")} of ${who}`;
}

/** Whether where it lies may be believed, and what speaks against it. */
export function certaintyInWords({ candidates, doubts, is_certain: isCertain }: UnalignedFrame): string {
  if (candidates.length === 0) return "Nothing on the level resembles this map yet.";
  if (isCertain) return "It lies here for certain.";
  return doubts.length === 0 ? "It may lie here." : `It may lie here, but ${listed(doubts.map((doubt) => DOUBT_WORDS[doubt]))}.`;
}

export function poseInWords({ x_m: x, y_m: y, heading_rad: heading }: UncertainPose): string {
  return `${coordinate(x)}, ${coordinate(y)}, turned by ${degrees(heading)}`;
}

/** What speaks for a place. */
export function candidateInWords({ agreed_m: agreed, conflicting_m: conflicting, residual_m: residual, landmarks, overlap }: AlignmentCandidate): string {
  return [
    `${lengthInWords(agreed)} of wall agree within ${lengthInWords(residual)}`,
    conflicting < 0.005 ? "nothing against it" : `${lengthInWords(conflicting)} against it`,
    counted(landmarks, "landmark"),
    `${Math.round(overlap * 100)} % in common`,
  ].join(" · ");
}

/** What stands in the log of a frame. */
export function alignmentInWords({ pose, contributions, author, at, withdrawn }: Alignment, nowMs: number): string {
  const by = author === "rule" ? "by rule" : `by token ${author}`;
  const parts = [`at ${poseInWords(pose)}`, counted(contributions, "contribution"), `${by}, ${ago(Date.parse(at), nowMs)}`];
  return [...parts, ...(withdrawn == null ? [] : ["withdrawn"])].join(" · ");
}

/** How many wait, in words. */
export function waitingInWords({ unaligned }: AlignmentsState): string {
  if (unaligned === null) return "Asking which robots came with maps of their own …";
  if (unaligned.length === 0) return "No robot waits with a map in a frame of its own.";
  return `${counted(unaligned.length, "frame")} ${unaligned.length === 1 ? "waits" : "wait"} for a place on the level.`;
}
