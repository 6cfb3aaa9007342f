// What the card of frames asks of the server: where robots' own maps lie, and to accept or withdraw that.

import { inWords, isAborted, type Api } from "./api";
import { frameInWords, poseInWords, type AlignmentsState } from "./alignments";
import { createCoalescer, type Timers } from "./coalesce";
import type { Place } from "./permalink";
import { hasEnded } from "./session";
import { may, samePlace, type State } from "./state";
import type { Dispatch } from "./store";
import type { UncertainPose } from "./wire";

/** Least time between two questions: working a proposal out may take seconds. */
const INTERVAL_MS = 5_000;

/** What the card can be told to do. */
export interface AlignmentActions {
  open: (open: boolean) => void;
  /** The map has gone on. */
  refresh: () => void;
  accept: (frame: string, pose: UncertainPose) => void;
  withdraw: (frame: string) => void;
}

export interface AlignmentActionsOptions {
  api: Api;
  state: () => State;
  dispatch: Dispatch;
  timers: Timers;
}

export function createAlignmentActions({ api, state, dispatch, timers }: AlignmentActionsOptions): AlignmentActions {
  const change = (alignments: Partial<AlignmentsState>): void => {
    dispatch({ kind: "alignments", alignments });
  };
  const failed = (place: Place, error: unknown): void => {
    if (isAborted(error) || !samePlace(place, state().place) || hasEnded(error, dispatch)) return;
    change({ answering: null, problem: inWords(error) });
  };

  const reading = createCoalescer({
    intervalMs: INTERVAL_MS,
    timers,
    run: async () => {
      const { place, alignments } = state();
      if (place === null || !alignments.open) return;
      try {
        const { unaligned, alignments: log } = await api.alignments(place);
        if (samePlace(place, state().place)) change({ unaligned, alignments: log });
      } catch (error) {
        failed(place, error);
      }
    },
  });

  /** Does something about a frame, and says so. */
  const answer = async (frame: string, ask: (place: Place) => Promise<unknown>, done: string): Promise<void> => {
    const { place, alignments } = state();
    if (place === null || alignments.answering !== null) return;
    change({ answering: frame, problem: null, done: null });
    try {
      await ask(place);
      if (!samePlace(place, state().place)) return;
      change({ answering: null, done });
    } catch (error) {
      failed(place, error);
    }
    reading.request();
  };

  return {
    open: (open) => {
      if (open === state().alignments.open) return;
      change({ open, problem: null, done: null });
      if (open) reading.request();
    },
    refresh: () => {
      if (state().alignments.open) reading.request();
    },
    accept: (frame, pose) => void answer(frame, (place) => api.align(place, frame, pose), `${frameInWords(frame)} lies at ${poseInWords(pose)} now.`),
    withdraw: (frame) => void answer(frame, (place) => api.withdrawAlignment(place, frame), `${frameInWords(frame)} is off the map; what it brought is held again.`),
  };
}

/** Whether the operator may say where a frame lies. */
export function mayAlign(state: State): boolean {
  return may(state, "map:edit");
}
