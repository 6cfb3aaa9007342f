import { describe, expect, it, vi } from "vitest";
import { Refused, Unreachable, type Api } from "../src/api";
import { edited } from "../src/editing";
import { createEditActions, editOf, type Memory } from "../src/editing/acting";
import { keyOf } from "../src/editing/keeping";
import { moved, type Objects } from "../src/editing/objects";
import { shifted } from "../src/editing/verbs";
import { update, type Event, type State } from "../src/state";
import type { GdbCollection, GdbEntry, GdbObject, Problem } from "../src/wire";
import { corner, TABLE } from "./editing_samples";
import { after, ON_GROUND } from "./samples";

const KEY = keyOf({ site: "plant", level: "ground" });

function collection(objects: Objects, revision: number): GdbCollection {
  return { type: "FeatureCollection", revision, library: 1, features: [...objects].map(([id, properties]) => ({ id, properties })) };
}

function entry(revision: number, fields: Partial<GdbEntry> = {}): GdbEntry {
  return { id: `e${revision}`, revision, kind: "edit", draft: revision, library: 1, at: "2026-11-22T12:00:00Z", author: "mia", comment: "", put: 1, removed: 0, ...fields };
}

function problem(status: number, errors: NonNullable<Problem["errors"]>): Refused {
  return new Refused(status, { type: "", title: "", status, detail: "The model has moved on.", code: "x", errors, retryable: false });
}

/** A page on a level whose draft is `corner()` at revision 5; its browser remembers `text`. */
function started({ text = null, isFull = false }: { text?: string | null; isFull?: boolean } = {}) {
  let state: State = after(...ON_GROUND);
  const draftModel = vi.fn<Api["draftModel"]>().mockResolvedValue(collection(corner(), 5));
  const editModel = vi.fn<Api["editModel"]>().mockResolvedValue({ draft: 6, library: 1, entry: entry(6) });
  const modelEntries = vi.fn<Api["modelEntries"]>().mockResolvedValue({ entries: [entry(5)] });
  const previewEdit = vi.fn<Api["previewEdit"]>().mockResolvedValue({ draft: 5, new: 0, changed: 0, removed: 0, findings: [], more_findings: false });
  const prototypes = vi.fn<Api["prototypes"]>().mockResolvedValue({ type: "FeatureCollection", features: [{ id: "table", properties: TABLE }] });
  const memory = new Map<string, string>(text === null ? [] : [[KEY, text]]);
  const storage: Memory = {
    getItem: (key) => memory.get(key) ?? null,
    setItem: (key, value) => {
      if (isFull) throw new DOMException("full", "QuotaExceededError");
      memory.set(key, value);
    },
    removeItem: (key) => {
      memory.delete(key);
    },
  };
  let later: (() => void)[] = [];
  const dispatch = (event: Event): void => {
    const before = state;
    state = update(state, event);
    // As main.ts does.
    const { copy, clashes } = state.editing;
    if (copy !== null && (copy !== before.editing.copy || clashes !== before.editing.clashes)) actions.changed();
  };
  const actions = createEditActions({
    api: { draftModel, editModel, modelEntries, previewEdit, prototypes } as unknown as Api,
    state: () => state,
    dispatch,
    memory: storage,
    timers: { setTimeout: (run) => later.push(run), clearTimeout: () => undefined },
    uuid: () => "new",
  });
  return {
    actions,
    memory,
    draftModel,
    editModel,
    modelEntries,
    previewEdit,
    dispatch,
    state: () => state,
    editing: () => state.editing,
    move: (id: string) => {
      actions.change(edited(state.editing, "move", shifted(state.editing.copy?.now ?? new Map(), [id], [1, 0])));
    },
    quiet: () => {
      const due = later;
      later = [];
      for (const run of due) run();
    },
  };
}

async function settled(): Promise<void> {
  for (let n = 0; n < 20; n++) await Promise.resolve();
}

async function opened(options: Parameters<typeof started>[0] = {}) {
  const page = started(options);
  page.actions.start();
  await settled();
  return page;
}

function table(draft: Objects, by: [number, number]): Map<string, GdbObject> {
  return new Map([...draft, ["table", moved(draft.get("table") ?? { kind: "other" }, by)]]);
}

describe("editing", () => {
  it("opens the draft with the library, and only for who may edit", async () => {
    const page = await opened();
    expect(page.editing()).toMatchObject({ on: true, busy: null, problem: null });
    expect(page.editing().copy?.version).toEqual({ draft: 5, library: 1 });
    expect([...page.editing().library.keys()]).toEqual(["table"]);
    const reader = started();
    reader.dispatch({ kind: "session", session: { kind: "in", who: { id: "t", scopes: ["map:read"] } } });
    reader.actions.start();
    expect(reader.editing().on).toBe(false);
  });

  it("sends what is another than the draft, with the version that was seen", async () => {
    const page = await opened();
    page.move("table");
    page.actions.change({ comment: " nearer to the door " });
    page.actions.send();
    await settled();
    const [, edit, made] = page.editModel.mock.lastCall ?? [];
    expect(edit?.put.map(({ id }) => id)).toEqual(["table"]);
    expect(edit?.remove).toEqual([]);
    expect(made).toEqual({ draft: 5, library: 1, comment: "nearer to the door" });
    expect(page.editing()).toMatchObject({ busy: null, comment: "", done: "In the draft: 1 object, at revision 6." });
    expect(page.editing().copy?.version).toEqual({ draft: 6, library: 1 });
    expect(page.memory.size).toBe(0);
    page.actions.send();
    expect(page.editModel).toHaveBeenCalledTimes(1);
  });

  it("keeps edits that were refused as stale, says who was faster, and goes on from theirs", async () => {
    const page = await opened();
    page.move("table");
    page.move("north");
    page.editModel.mockRejectedValueOnce(problem(412, [{ pointer: "/put/0", code: "object_changed", detail: 'object 00000000-0000-7000-8000-000000000000 was changed at revision 6 by "mia"' }]));
    page.draftModel.mockResolvedValue(collection(table(corner(), [0, 3]), 6));
    page.modelEntries.mockResolvedValue({ entries: [entry(6, { comment: "table to the wall" }), entry(5)] });
    page.actions.send();
    await settled();
    const now = page.editing();
    expect(now.problem).toContain("None is lost");
    expect(now.problem).toContain('by "mia"');
    expect(now.news.join()).toContain("table to the wall");
    expect(now.clashes.map(({ id }) => id)).toEqual(["table"]);
    expect(now.copy?.version).toEqual({ draft: 6, library: 1 });
    // What the browser keeps has it all.
    expect(page.memory.get(KEY)).toContain('"clashes":[{"id":"table"');
    page.actions.takeMine("table");
    expect(page.editing().clashes).toEqual([]);
    page.actions.send();
    await settled();
    expect(page.editModel.mock.lastCall?.[1].put.map(({ id }) => id).sort()).toEqual(["north", "table"]);
    expect(page.editModel.mock.lastCall?.[2].draft).toBe(6);
  });

  it("leaves the draft's version where the operator drops his", async () => {
    const page = await opened();
    page.move("table");
    page.draftModel.mockResolvedValue(collection(table(corner(), [0, 3]), 6));
    page.modelEntries.mockResolvedValue({ entries: [entry(6)] });
    page.dispatch({ kind: "model", model: { revision: 6 } });
    page.actions.refresh();
    await settled();
    expect(page.editing().clashes).toHaveLength(1);
    page.actions.dropMine("table");
    expect(page.editing().clashes).toEqual([]);
    expect(page.editing().copy?.now.get("table")?.placement?.position_m).toEqual([1, 5, 0]);
    expect(page.memory.size).toBe(0);
  });

  it("loses nothing when the server is gone, or takes an object for wrong", async () => {
    const page = await opened();
    page.move("table");
    page.editModel.mockRejectedValueOnce(new Unreachable("The server cannot be reached."));
    page.actions.send();
    await settled();
    expect(page.editing().problem).toContain("cannot be reached");
    page.editModel.mockRejectedValueOnce(problem(422, [{ pointer: "/put/0/properties/name", code: "bad_name", detail: "too long" }]));
    page.actions.send();
    await settled();
    expect(page.editing().problem).toBe("Your edits were not taken, and none is lost. table: too long");
    expect(page.editing().copy?.done).toHaveLength(1);
    expect(page.memory.has(KEY)).toBe(true);
  });

  it("goes on after a reload with what was kept, on the draft of now", async () => {
    const page = await opened();
    page.move("table");
    page.actions.stop();
    expect(page.editing().on).toBe(false);
    const text = page.memory.get(KEY) ?? "";
    const again = started({ text });
    again.actions.arrived();
    await settled();
    expect(again.editing().on).toBe(true);
    expect(again.editing().copy?.now.get("table")?.placement?.position_m).toEqual([2, 2, 0]);
    again.actions.discard();
    expect(again.memory.size).toBe(0);
    const none = started();
    none.actions.arrived();
    expect(none.editing().on).toBe(false);
  });

  it("says so if the browser cannot keep what is not sent", async () => {
    const page = await opened({ isFull: true });
    page.move("table");
    expect(page.editing().isKept).toBe(false);
  });

  it("asks what would be wrong once nothing has changed for a while", async () => {
    const page = await opened();
    page.move("table");
    page.previewEdit.mockResolvedValue({ draft: 5, new: 0, changed: 1, removed: 0, findings: [{ severity: "warning", code: "overlap", detail: "two objects" }], more_findings: false });
    expect(page.editing().findings).toBeNull();
    page.quiet();
    await settled();
    expect(page.editing().findings).toHaveLength(1);
    page.move("table");
    expect(page.editing().findings).toBeNull();
  });

  it("shows the draft in space to who only looks, and keeps nothing for it", async () => {
    const page = started({ text: "kept earlier" });
    page.actions.turnSpace();
    await settled();
    expect(page.editing()).toMatchObject({ on: false, is3d: true });
    expect(page.editing().copy?.now.size).toBe(4);
    page.quiet();
    expect(page.previewEdit).not.toHaveBeenCalled();
    expect(page.memory.get(KEY)).toBe("kept earlier");
    page.actions.turnSpace();
    expect(page.editing()).toMatchObject({ is3d: false, copy: null });
  });

  it("sends removals as such", () => {
    expect(editOf(new Map([["a", null]]))).toEqual({ put: [], remove: ["a"] });
  });
});
