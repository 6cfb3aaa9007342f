import { describe, expect, it } from "vitest";
import { edited, stepped, unsentCount } from "../src/editing";
import { difference, editOf, inverse, redo, undo, unsent, withEdit, withPuts, withSent, type Puts } from "../src/editing/history";
import { same, type Objects } from "../src/editing/objects";
import { copied, drawn, pulled, removed, reshaped, rotated, shifted, withDoorways } from "../src/editing/verbs";
import { wallsAmong } from "../src/editing/walls";
import type { Point } from "../src/geometry";
import { asWall, copyOf, corner, counting, editing, wall } from "./editing_samples";
import { createRandom } from "./mock/random.mjs";

function expectSame(got: Objects, wanted: Objects): void {
  expect([...difference(wanted, got)]).toEqual([]);
}

describe("edits", () => {
  it("of any kind are taken back and made again, whatever the order", () => {
    const random = createRandom(11);
    const { uuid } = counting();
    const some = (objects: Objects): string[] => [...objects.keys()].filter(() => random() < 0.4);
    const place = (): Point => [random() * 8, random() * 8];
    const verbs: ((objects: Objects) => Puts | null)[] = [
      (objects) => shifted(objects, some(objects), [random() - 0.5, random() - 0.5]),
      (objects) => rotated(objects, some(objects), place(), random() * 6),
      (objects) => copied(objects, some(objects), [1, 1], uuid).puts,
      (objects) => removed(objects, some(objects).slice(0, 2)),
      () => null,
      (objects) => drawn(objects, [place(), place(), place()], { thicknessM: 0.1, heightM: 2.5 }, uuid),
      (objects) => {
        const [first] = wallsAmong(objects).values();
        return first === undefined ? null : pulled(objects, first.a, place());
      },
    ];
    for (let round = 0; round < 30; round++) {
      let copy = copyOf(corner());
      const states = [copy.now];
      for (let step = 0; step < 12; step++) {
        const puts = verbs[Math.floor(random() * verbs.length)]?.(copy.now) ?? null;
        const edit = puts === null ? null : editOf("x", copy.now, puts);
        if (edit === null) continue;
        copy = withEdit(copy, edit);
        states.push(copy.now);
        expectSame(withPuts(withPuts(copy.now, new Map([...inverse(edit).objects].map(([id, { after }]) => [id, after]))), new Map()), states.at(-2) ?? new Map());
      }
      for (let back = states.length - 2; back >= 0; back--) {
        copy = undo(copy);
        expectSame(copy.now, states[back] ?? new Map());
      }
      expect(undo(copy)).toBe(copy);
      expect(unsent(copy).size).toBe(0);
      for (const wanted of states.slice(1)) {
        copy = redo(copy);
        expectSame(copy.now, wanted);
      }
      expect(redo(copy)).toBe(copy);
    }
  });

  it("that change nothing are none, and a new one ends what could be made again", () => {
    const state = editing(corner());
    const objects = state.copy?.now ?? new Map();
    expect(editOf("x", objects, new Map([["east", { ...asObject(objects, "east") }]]))).toBeNull();
    const moved = { ...state, ...edited(state, "move", shifted(objects, ["table"], [1, 0])) };
    const back = { ...moved, ...stepped(moved, "undo") };
    expect(back.copy?.undone).toHaveLength(1);
    const other = { ...back, ...edited(back, "move", shifted(objects, ["table"], [0, 1])) };
    expect(other.copy?.undone).toHaveLength(0);
  });

  it("that are sent can still be taken back, which is to be sent again", () => {
    const before = copyOf(corner());
    const edit = editOf("move", before.now, shifted(before.now, ["table"], [1, 0]));
    if (edit === null) throw new Error("no edit");
    const copy = withEdit(before, edit);
    const sent = withSent(copy, unsent(copy), { draft: 6, library: 1 });
    expect(unsent(sent).size).toBe(0);
    expect([...unsent(undo(sent)).keys()]).toEqual(["table"]);
    expect(undo(sent).version).toEqual({ draft: 6, library: 1 });
  });
});

function asObject(objects: Objects, id: string): NonNullable<ReturnType<Objects["get"]>> {
  const object = objects.get(id);
  if (object === undefined) throw new Error(`no ${id}`);
  return object;
}

describe("a wall", () => {
  it("takes its doorways along when it is moved, turned, copied or removed", () => {
    const objects = corner();
    expect([...withDoorways(objects, ["east"])]).toEqual(["east", "door"]);
    expect([...shifted(objects, ["east"], [0, 1]).keys()]).toContain("door");
    expect(removed(objects, ["east"]).get("door")).toBeNull();
    const { puts, copies } = copied(objects, ["east"], [0, -2], counting().uuid);
    expect(copies).toHaveLength(2);
    expect([...puts.values()].map((object) => object?.kind)).toEqual(["wall", "doorway"]);
  });

  it("that is pulled at a corner takes the walls that end there along", () => {
    const objects = corner();
    const puts = pulled(objects, [4, 0], [5, 0]);
    const now = withPuts(objects, puts ?? new Map());
    expect(asWall(now.get("east")).b).toEqual([5, 0]);
    expect(asWall(now.get("north")).a).toEqual([5, 0]);
    // Two metres from the end that stayed.
    expect(now.get("door")?.placement?.position_m).toEqual([2, 0, 0]);
    expect(pulled(objects, [4, 0], [0, 0])).toBeNull();
  });

  it("drawn as a room has its corners closed, and none once it is alone", () => {
    const ids = counting("w");
    const room = withPuts(new Map(), drawn(new Map(), [[0, 0], [4, 0], [4, 3], [0, 3], [0, 0]], { thicknessM: 0.1, heightM: 2.5 }, ids.uuid));
    expect(room.size).toBe(4);
    const fillers = [...room.values()].reduce((sum, { solids }) => sum + (solids?.length ?? 0) - 1, 0);
    expect(fillers).toBe(4);
    const left = withPuts(room, removed(room, ["w-1", "w-3"]));
    expect([...left.values()].every(({ solids }) => solids?.length === 1)).toBe(true);
  });

  it("keeps its name and tolerance when it is reshaped", () => {
    const objects = corner();
    objects.set("east", { ...asObject(objects, "east"), name: "south side", tolerance_m: 0.01 });
    const now = withPuts(objects, reshaped(objects, new Map([["east", wall([0, 0], [4, 0], { thicknessM: 0.3 })]])));
    expect(now.get("east")).toMatchObject({ name: "south side", tolerance_m: 0.01 });
    expect(asWall(now.get("east")).thicknessM).toBe(0.3);
    expect(same(now.get("north"), objects.get("north"))).toBe(true);
  });
});

describe("what is unsent", () => {
  it("is counted in objects", () => {
    const state = editing(corner());
    const objects = state.copy?.now ?? new Map();
    const next = { ...state, ...edited(state, "move", shifted(objects, ["east"], [0, 1])) };
    expect(unsentCount(next)).toBe(2);
    expect(unsentCount({ ...next, ...stepped(next, "undo") })).toBe(0);
  });
});
