import { describe, expect, it } from "vitest";
import { clashInWords, newsInWords } from "../src/editing";
import { editOf, undo, unsent, withEdit, withPuts, type Puts, type WorkingCopy } from "../src/editing/history";
import { kept, keyOf, restored } from "../src/editing/keeping";
import { moved, type Objects } from "../src/editing/objects";
import { rebased } from "../src/editing/rebasing";
import { removed, shifted } from "../src/editing/verbs";
import type { GdbObject } from "../src/wire";
import { copyOf, corner, doorway } from "./editing_samples";

const LATER = { draft: 9, library: 1 };

function after(objects: Objects, puts: Puts): WorkingCopy {
  const copy = copyOf(objects);
  const edit = editOf("mine", objects, puts);
  return edit === null ? copy : withEdit(copy, edit);
}

function at(objects: Objects, id: string): GdbObject {
  const object = objects.get(id);
  if (object === undefined) throw new Error(`no ${id}`);
  return object;
}

describe("unsent edits on a newer draft", () => {
  it("stay where others changed other things", () => {
    const objects = corner();
    const copy = after(objects, shifted(objects, ["table"], [1, 0]));
    const theirs = withPuts(objects, new Map<string, GdbObject | null>([["north", null], ["chair", { kind: "other", prototype: "table" }]]));
    const { copy: next, clashes, news } = rebased(copy, theirs, LATER);
    expect(clashes).toEqual([]);
    expect(news).toEqual({ added: 1, changed: 0, removed: 1 });
    expect([...unsent(next).keys()]).toEqual(["table"]);
    expect(next.now.has("chair")).toBe(true);
    expect(next.now.has("north")).toBe(false);
    expect(next.version).toEqual(LATER);
    expect([...unsent(undo(next))]).toEqual([]);
  });

  it("are set aside, with both versions, where others changed the same", () => {
    const objects = corner();
    const copy = after(objects, shifted(objects, ["table", "north"], [1, 0]));
    const theirs = withPuts(objects, new Map([["table", moved(at(objects, "table"), [0, 5])]]));
    const { copy: next, clashes } = rebased(copy, theirs, LATER);
    expect(clashes.map(({ id, why }) => [id, why])).toEqual([["table", "both"]]);
    expect(clashes[0]?.mine).toEqual(copy.now.get("table"));
    expect(next.now.get("table")).toEqual(theirs.get("table"));
    // The rest of the same edit stays, and is taken back without it.
    expect([...unsent(next).keys()]).toEqual(["north"]);
    expect(undo(next).now.get("table")).toEqual(theirs.get("table"));
  });

  it("are no clash where others made the same of it", () => {
    const objects = corner();
    const puts = shifted(objects, ["table"], [1, 0]);
    const { copy, clashes } = rebased(after(objects, puts), withPuts(objects, puts), LATER);
    expect(clashes).toEqual([]);
    expect(unsent(copy).size).toBe(0);
  });

  it("take a doorway and its wall for one", () => {
    const objects = corner();
    const mine = after(objects, new Map([["hatch", doorway(at(objects, "east"), 3.3)]]));
    const theirs = withPuts(objects, shifted(objects, ["east"], [0, 1]));
    expect(rebased(mine, theirs, LATER).clashes.map(({ id, why }) => [id, why])).toEqual([["hatch", "wall"]]);
    // I move the wall in which they open a doorway.
    const moving = after(objects, shifted(objects, ["east"], [0, 1]));
    const opened = withPuts(objects, new Map([["hatch", doorway(at(objects, "east"), 3.3)]]));
    const found = rebased(moving, opened, LATER).clashes.map(({ id, why }) => [id, why]);
    expect(found).toEqual(expect.arrayContaining([["east", "doorway"], ["door", "wall"]]));
  });

  it("keep the wish to remove what others changed", () => {
    const objects = corner();
    const { clashes } = rebased(after(objects, removed(objects, ["table"])), withPuts(objects, new Map([["table", moved(at(objects, "table"), [1, 1])]])), LATER);
    expect(clashes[0]).toMatchObject({ id: "table", mine: null });
    expect(clashInWords(clashes[0] ?? { id: "", mine: null, theirs: null, why: "both" })).toContain("you removed it");
  });

  it("are told with who changed what", () => {
    const entry = { id: "e", revision: 9, kind: "edit" as const, draft: 9, library: 1, at: "2026-11-22T12:00:00Z", author: "mia", comment: "north door", put: 1, removed: 0 };
    const words = newsInWords({ added: 1, changed: 0, removed: 2 }, [entry]);
    expect(words[0]).toBe("Others have changed the draft: 1 new and 2 removed.");
    expect(words[1]).toContain("Token mia");
    expect(words[1]).toContain("north door");
    expect(newsInWords({ added: 0, changed: 0, removed: 0 }, [])).toEqual([]);
  });
});

describe("what the browser keeps", () => {
  it("is nothing once all is sent", () => {
    expect(kept(copyOf(corner()), [])).toBeNull();
    expect(keyOf({ site: "a/b", level: "1" })).toBe("mapfold.edits.a%2Fb.1");
  });

  it("comes back as it was on the same draft", () => {
    const objects = corner();
    const copy = after(objects, shifted(objects, ["east"], [0, 1]));
    const text = kept(copy, []) ?? "";
    const back = restored(text, corner(), copy.version);
    expect(back?.clashes).toEqual([]);
    expect([...(back === null ? [] : unsent(back.copy))]).toEqual([...unsent(copy)]);
    expect(back === null ? null : unsent(undo(back.copy)).size).toBe(0);
  });

  it("comes back on a newer draft as if the page had never been away", () => {
    const objects = corner();
    const copy = after(objects, new Map([["hatch", doorway(at(objects, "east"), 3.3)]]));
    const theirs = withPuts(objects, shifted(objects, ["east"], [0, 1]));
    const back = restored(kept(copy, []) ?? "", theirs, LATER);
    expect(back?.clashes).toEqual(rebased(copy, theirs, LATER).clashes);
    const again = restored(kept(back?.copy ?? copy, back?.clashes ?? []) ?? "", theirs, LATER);
    expect(again?.clashes).toHaveLength(1);
  });

  it("is refused if it is not of this page", () => {
    for (const text of ["", "{", "{}", '{"format":2}', "[]"]) expect(restored(text, new Map(), LATER)).toBeNull();
  });
});
