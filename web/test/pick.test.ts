import { describe, expect, it } from "vitest";
import { pick } from "../src/pick";
import { update, type State } from "../src/state";
import { after, chain, cluster, ON_GROUND, segment, vectorPatch } from "./samples";

/** The wall x = 2, y 1 to 4; another wall on the same line, y 10 to 12; a cluster; a robot at the origin. */
const state: State = [
  {
    kind: "vector",
    patch: vectorPatch(0, 1, {
      segments: [segment("wall"), segment("far", { solid: [{ from_m: 10, to_m: 12, ends: ["jump", "jump"], existence_nat: 8.67 }] })],
      clusters: [cluster("thing")],
    }),
  } as const,
].reduce(update, after(...ON_GROUND));
const RESOLUTION = 0.05;

describe("picking", () => {
  it("finds the wall near the pointer, within eight pixels", () => {
    expect(pick(state, [2.39, 2], RESOLUTION)).toEqual({ kind: "segment", id: "wall" });
    expect(pick(state, [2.41, 2], RESOLUTION)).toBeNull();
    expect(pick(state, [2, 4.3], RESOLUTION)).toEqual({ kind: "segment", id: "wall" });
  });

  it("does not take a wall for one that lies on the same line elsewhere", () => {
    expect(pick(state, [2, 7], RESOLUTION)).toBeNull();
    expect(pick(state, [2, 11], RESOLUTION)).toEqual({ kind: "segment", id: "far" });
  });

  it("takes the nearest of several", () => {
    const both = update(state, {
      kind: "vector",
      patch: vectorPatch(1, 2, { segments: [segment("near", { rho_m: 2.2 })] }),
    });
    expect(pick(both, [2.15, 2], RESOLUTION)?.id).toBe("near");
    expect(pick(both, [2.05, 2], RESOLUTION)?.id).toBe("wall");
  });

  it("finds a cluster from inside and from its edge", () => {
    expect(pick(state, [5.5, 5.5], RESOLUTION)).toEqual({ kind: "cluster", id: "thing" });
    expect(pick(state, [6.3, 5.5], RESOLUTION)).toEqual({ kind: "cluster", id: "thing" });
    expect(pick(state, [6.5, 5.5], RESOLUTION)).toBeNull();
  });

  it("finds a chain at its corners, along its edges and inside an obstacle, below all else", () => {
    const wall = segment("w", { rho_m: 5, alpha_rad: Math.PI / 2, solid: [{ from_m: -7, to_m: -5, ends: ["corner", "corner"], existence_nat: 8.67 }] });
    const patch = vectorPatch(0, 2, { segments: [wall], chains: [chain("box")] });
    const boxed = update(state, { kind: "vector", patch });
    expect(pick(boxed, [5.1, 4.9], RESOLUTION)).toEqual({ kind: "chain", id: "box" });
    expect(pick(boxed, [6, 5.1], RESOLUTION)).toEqual({ kind: "segment", id: "w" });
    expect(pick(boxed, [5.1, 6], RESOLUTION)).toEqual({ kind: "chain", id: "box" });
    expect(pick(boxed, [6, 6], RESOLUTION)).toEqual({ kind: "chain", id: "box" });
    const room = update(boxed, { kind: "vector", patch: vectorPatch(2, 3, { chains: [chain("box", { kind: "room" })] }) });
    expect(pick(room, [6, 6], RESOLUTION)).toBeNull();
    const open = update(boxed, { kind: "vector", patch: vectorPatch(2, 3, { chains: [chain("box", { kind: "polyline", closed: false })] }) });
    expect(pick(open, [6, 5.1], RESOLUTION)?.kind).toBe("segment");
    expect(pick(open, [5.1, 6], RESOLUTION)?.id).toBe("box");
    const hidden = update(boxed, { kind: "layer", name: "chains", setting: { on: false } });
    expect(pick(hidden, [6, 6], RESOLUTION)).toBeNull();
  });

  it("prefers robots to what is below them", () => {
    const above = update(state, {
      kind: "vector",
      patch: vectorPatch(1, 2, { segments: [segment("under", { rho_m: 0, solid: [{ from_m: -3, to_m: 3, ends: ["jump", "jump"], existence_nat: 8.67 }] })] }),
    });
    expect(pick(above, [0.1, 0], RESOLUTION)).toEqual({ kind: "robot", id: "ada" });
    expect(pick(above, [0.1, 2], RESOLUTION)).toEqual({ kind: "segment", id: "under" });
  });

  it("finds nothing of what is not shown", () => {
    const hidden = update(state, { kind: "layer", name: "segments", setting: { on: false } });
    expect(pick(hidden, [2, 2], RESOLUTION)).toBeNull();
  });
});
