import { describe, expect, it } from "vitest";
import { alignmentInWords, candidateInWords, certaintyInWords, heldInWords, NO_ALIGNMENTS, poseInWords, waitingInWords } from "../src/alignments";
import type { Alignment, AlignmentCandidate, UnalignedFrame, UncertainPose } from "../src/wire";
import { NOON_MS } from "./samples";

const POSE: UncertainPose = { x_m: 12.34, y_m: -5, heading_rad: Math.PI / 2, covariance: [[0.01, 0, 0], [0, 0.01, 0], [0, 0, 0.001]] };
const CANDIDATE: AlignmentCandidate = { pose: POSE, overlap: 0.634, agreed_m: 34, conflicting_m: 0.4, residual_m: 0.032, landmarks: 12 };

function held(fields: Partial<UnalignedFrame> = {}): UnalignedFrame {
  return { frame: "0190a1b2-c3d4-7000-8000-000000000001", robots: ["ada", "bo"], contributions: 5, is_certain: false, doubts: [], candidates: [CANDIDATE], runner_up: 0, ...fields };
}

describe("a frame in words", () => {
  it("says who waits with what, and whether the place may be believed", () => {
    expect(heldInWords(held())).toBe("Frame 0190a1b2: 5 contributions of ada and bo");
    expect(certaintyInWords(held({ is_certain: true }))).toBe("It lies here for certain.");
    expect(certaintyInWords(held({ doubts: ["few_landmarks", "runner_up"] }))).toBe(
      "It may lie here, but they share too few landmarks and another place fits nearly as well.",
    );
    expect(certaintyInWords(held({ candidates: [] }))).toBe("Nothing on the level resembles this map yet.");
  });

  it("says where a place is and what speaks for it", () => {
    expect(poseInWords(POSE)).toBe("12.34 m, −5.00 m, turned by 90.0°");
    expect(candidateInWords(CANDIDATE)).toBe("34 m of wall agree within 3.2 cm · 40 cm against it · 12 landmarks · 63 % in common");
  });

  it("says who accepted it, and that it was withdrawn", () => {
    const alignment: Alignment = { revision: 9, frame: held().frame, pose: POSE, at: new Date(NOON_MS - 90_000).toISOString(), author: "rule", comment: "", contributions: 16 };
    expect(alignmentInWords(alignment, NOON_MS)).toBe("at 12.34 m, −5.00 m, turned by 90.0° · 16 contributions · by rule, 1 min ago");
    expect(alignmentInWords({ ...alignment, author: "mft", withdrawn: 11 }, NOON_MS)).toMatch(/by token mft, 1 min ago · withdrawn$/);
  });

  it("counts those that wait", () => {
    expect(waitingInWords(NO_ALIGNMENTS)).toBe("Asking which robots came with maps of their own …");
    expect(waitingInWords({ ...NO_ALIGNMENTS, unaligned: [] })).toBe("No robot waits with a map in a frame of its own.");
    expect(waitingInWords({ ...NO_ALIGNMENTS, unaligned: [held()] })).toBe("1 frame waits for a place on the level.");
  });
});
