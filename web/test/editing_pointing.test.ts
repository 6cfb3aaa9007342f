import { describe, expect, it } from "vitest";
import { shownObjects, type EditingState } from "../src/editing";
import { commanded } from "../src/editing/commands";
import { figuresOf, named, wallTyped } from "../src/editing/figures";
import { commandOf, type Key } from "../src/editing/keys";
import { clicked, dragged, finished, grasped, hovered, released, withTool } from "../src/editing/pointing";
import { hostOf } from "../src/editing/doorways";
import { yawOf } from "../src/editing/objects";
import { wallsAmong } from "../src/editing/walls";
import type { Point } from "../src/geometry";
import { asWall, corner, counting, editing, mouse } from "./editing_samples";

const hand = counting();

function after(state: EditingState, ...steps: ((now: EditingState) => Partial<EditingState> | null)[]): EditingState {
  return steps.reduce((now, step) => ({ ...now, ...step(now) }), state);
}

const click = (at: Point, fields = {}) => (now: EditingState) => clicked(now, mouse(at, fields), hand);
const drag = (from: Point, to: Point, fields = {}) => (now: EditingState) =>
  after(now, (one) => grasped(one, mouse(from, fields)), (one) => dragged(one, mouse(to, fields)), released);

const empty = (): EditingState => editing(new Map(), { tool: "wall" });
const now = (state: EditingState): ReadonlyMap<string, NonNullable<ReturnType<typeof shownObjects>["get"] extends (id: string) => infer T ? T : never>> => shownObjects(state);
const key = (name: string, fields: Partial<Key> = {}): Key => ({ key: name, ctrl: false, shift: false, alt: false, ...fields });

describe("the wall tool", () => {
  it("draws a room that closes on its first corner, as one edit", () => {
    const room = after(empty(), click([0.02, 0.03]), click([4.02, 0.04]), click([4.01, 2.98]), click([0.03, 3.02]), click([0.04, 0.05]));
    const walls = [...wallsAmong(now(room)).values()];
    expect(walls.map(({ a, b }) => [...a, ...b])).toEqual([[0, 0, 4, 0], [4, 0, 4, 3], [4, 3, 0, 3], [0, 3, 0, 0]]);
    expect(room.sketch.kind).toBe("none");
    expect(room.copy?.done).toHaveLength(1);
    expect(room.chosen.size).toBe(4);
    expect(now(after(room, (one) => commanded(one, "undo", hand))).size).toBe(0);
  });

  it("ends on a second click at the same place, and takes its last place back", () => {
    const line = after(empty(), click([0, 0]), click([2, 0]), click([2, 2]), (one) => commanded(one, "undo", hand), click([2, 0]));
    expect([...wallsAmong(now(line)).values()].map(({ b }) => b)).toEqual([[2, 0]]);
    expect(now(after(empty(), click([0, 0]), (one) => finished(one, hand))).size).toBe(0);
  });

  it("takes a length and a direction from the keyboard", () => {
    const line = after(empty(), click([1, 1]), (one) => wallTyped(one, 2.345, 90, hand), (one) => wallTyped(one, 1, null, hand), (one) => finished(one, hand));
    const ends = [...wallsAmong(now(line)).values()].map(({ b }) => b);
    expect(ends).toEqual([[1, 3.345], [2, 3.345]]);
  });
});

describe("the doorway tool", () => {
  it("shows where the doorway would be, and puts it into the middle of a wall", () => {
    const state = editing(corner(), { tool: "doorway" });
    const over = after(state, (one) => hovered(one, mouse([4.06, 1.46])));
    expect(now(over).size).toBe(5);
    expect(over.copy?.now.size).toBe(4);
    const put = after(over, click([4.06, 1.46]));
    const [id] = put.chosen;
    const doorway = now(put).get(id ?? "");
    expect(doorway).toMatchObject({ kind: "doorway", placement: { position_m: [4, 1.5, 0] } });
    expect(hostOf(doorway ?? { kind: "other" }, wallsAmong(now(put)))).toBe("north");
  });

  it("says what it needs where there is no wall", () => {
    expect(clicked(editing(corner(), { tool: "doorway" }), mouse([1, 1.5]), hand).problem).toContain("wall");
  });
});

describe("the prototype tool", () => {
  it("places an instance, turned as it was before", () => {
    const state = after(editing(corner()), (one) => withTool(one, "prototype", hand), (one) => commanded(one, "turn-left", hand), click([2.02, 6.03]));
    const [id] = state.chosen;
    const placed = now(state).get(id ?? "");
    expect(placed).toMatchObject({ kind: "furniture", prototype: "table", placement: { position_m: [2, 6, 0] } });
    expect(yawOf(placed ?? { kind: "other" })).toBeCloseTo(Math.PI / 12, 9);
  });
});

describe("the selection", () => {
  it("is what is clicked on: a doorway before its wall, several with shift", () => {
    const state = after(editing(corner()), click([2, 0]));
    expect([...state.chosen]).toEqual(["door"]);
    expect([...after(state, click([0.5, 0], { several: true })).chosen]).toEqual(["door", "east"]);
    expect([...after(state, click([2, 0], { several: true })).chosen]).toEqual([]);
    expect([...after(state, click([9, 9])).chosen]).toEqual([]);
  });

  it("takes what lies in a box", () => {
    const state = after(editing(corner()), drag([-0.5, 0.8], [3, 3.5], { several: true }));
    expect([...state.chosen]).toEqual(["table"]);
    expect([...after(state, drag([-1, 5], [5, -1], { several: true })).chosen].sort()).toEqual(["door", "east", "north", "table"]);
  });

  it("leaves the map to be moved where there is nothing", () => {
    expect(grasped(editing(corner()), mouse([9, 9]))).toBeNull();
    expect(grasped(editing(corner()), mouse([1, 2], { isTouch: true }))).toBeNull();
    expect(grasped(editing(corner(), { chosen: new Set(["table"]) }), mouse([1, 2], { isTouch: true }))).not.toBeNull();
  });
});

describe("dragging", () => {
  it("moves a wall with its doorway, onto the grid", () => {
    const state = after(editing(corner()), drag([0.3, 0.02], [0.32, 1.01]));
    expect(asWall(now(state).get("east"))).toMatchObject({ a: [0, 1], b: [4, 1] });
    expect(now(state).get("door")?.placement?.position_m).toEqual([2, 1, 0]);
  });

  it("moves the end of the chosen wall, and what ends there with it", () => {
    const state = after(editing(corner(), { chosen: new Set(["east"]) }), drag([4.03, 0.02], [5.02, 0.03]));
    expect(asWall(now(state).get("east")).b).toEqual([5, 0]);
    expect(asWall(now(state).get("north")).a).toEqual([5, 0]);
    expect(state.copy?.done.at(-1)?.label).toBe("move a corner");
  });

  it("slides a doorway along its wall, and into another", () => {
    const state = after(editing(corner()), drag([2, 0], [3.02, 0.05]));
    expect(now(state).get("door")?.placement?.position_m[1]).toBe(0);
    expect(now(state).get("door")?.placement?.position_m[0]).toBeCloseTo(3.05, 6);
    const over = after(editing(corner()), drag([2, 0], [4.03, 1.52]));
    expect(now(over).get("door")?.placement?.position_m).toEqual([4, 1.5, 0]);
  });
});

describe("keys", () => {
  it("mean tools, steps and nudges", () => {
    const state = editing(corner(), { chosen: new Set(["table"]) });
    expect(commandOf(key("w"), state)).toBe("tool-wall");
    expect(commandOf(key("z", { ctrl: true }), state)).toBe("undo");
    expect(commandOf(key("Z", { ctrl: true, shift: true }), state)).toBe("redo");
    expect(commandOf(key("z", { ctrl: true, shift: true }), state)).toBe("redo");
    expect(commandOf(key("Delete"), state)).toBe("remove");
    expect(commandOf(key("ArrowUp"), state)).toBe("nudge-up");
    expect(commandOf(key("ArrowUp"), { ...state, chosen: new Set() })).toBeNull();
    expect(commandOf(key("5"), after(empty(), click([0, 0])))).toBe("type-length");
    expect(commandOf(key("w"), { ...state, on: false })).toBeNull();
    expect(now(after(state, (one) => commanded(one, "nudge-up", hand))).get("table")?.placement?.position_m).toEqual([1, 2.1, 0]);
  });
});

describe("figures", () => {
  it("of a wall are read and typed", () => {
    const state = editing(corner(), { chosen: new Set(["north"]) });
    const of = (id: string) => {
      const figure = figuresOf(state).find((one) => one.id === id);
      if (figure === undefined) throw new Error(`no ${id}`);
      return figure;
    };
    expect([of("length").value, of("angle").value, of("thickness").value, of("height").value]).toEqual([3, 90, 10, 2.5]);
    expect(asWall(now(after(state, (one) => of("length").set(one, 5))).get("north")).b).toEqual([4, 5]);
    expect(asWall(now(after(state, (one) => of("thickness").set(one, 20))).get("north")).thicknessM).toBe(0.2);
    expect(now(after(state, (one) => named(one, "lift"))).get("north")?.name).toBe("lift");
  });

  it("of a doorway keep it in its wall", () => {
    const state = editing(corner(), { chosen: new Set(["door"]) });
    expect(figuresOf(state).map(({ id, value }) => [id, value])).toEqual([["width", 0.9], ["height", 2.1], ["from-end", 1.55]]);
    const wider = after(state, (one) => figuresOf(one)[0]?.set(one, 1.2) ?? {});
    expect(figuresOf(wider)[0]?.value).toBe(1.2);
  });

  it("of an instance are its place and its turn", () => {
    const state = editing(corner(), { chosen: new Set(["table"]) });
    expect(figuresOf(state).map(({ id, value }) => [id, value])).toEqual([["x", 1], ["y", 2], ["yaw", 0], ["z", 0]]);
    const turned = after(state, (one) => figuresOf(one)[2]?.set(one, 30) ?? {});
    expect(figuresOf(turned)[2]?.value).toBe(30);
  });
});
