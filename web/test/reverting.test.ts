import { describe, expect, it, vi } from "vitest";
import { Refused, type Api } from "../src/api";
import { createLogActions, mayRevert, shownPreview } from "../src/reverting";
import { update, type State } from "../src/state";
import type { Revert, RevertPreview } from "../src/wire";
import { after, entry, ON_GROUND } from "./samples";

const PREVIEW: RevertPreview = {
  revision: 9,
  contributions: 1,
  moved: 1,
  robots: [{ robot: "ada", contributions: 1 }],
  segments: { new: 0, changed: 1, removed: 0 },
  clusters: { new: 0, changed: 0, removed: 0 },
  tiles: { new: 0, changed: 0, removed: 0 },
  features: [],
  more_features: false,
};
const REVERT: Revert = {
  id: "id-1",
  revision: 10,
  at: "2026-11-22T12:00:00Z",
  author: "abc",
  reason: "drift",
  contributions: 1,
  taken_out: 1,
  robots: [],
};

function started(fields: Partial<Api> = {}) {
  let state: State = after(...ON_GROUND);
  let ids = 0;
  const contributions = vi
    .fn<Api["contributions"]>()
    .mockResolvedValue({ contributions: [entry(1, { id: "e" })], next: "7" });
  const revert = vi.fn<Api["revert"]>().mockResolvedValue(REVERT);
  const undoRevert = vi
    .fn<Api["undoRevert"]>()
    .mockResolvedValue({ ...REVERT, undone: { revision: 11, at: REVERT.at, author: "abc", put_back: 1 } });
  const api = {
    contributions,
    revert,
    undoRevert,
    reverts: vi.fn<Api["reverts"]>().mockResolvedValue({ reverts: [] }),
    previewRevert: vi.fn<Api["previewRevert"]>().mockResolvedValue(PREVIEW),
    previewUndo: vi.fn<Api["previewUndo"]>().mockResolvedValue(PREVIEW),
    ...fields,
  };
  const actions = createLogActions({
    api: api as unknown as Api,
    state: () => state,
    dispatch: (event) => {
      state = update(state, event);
    },
    uuid: () => `id-${String(++ids)}`,
  });
  const sent = {
    listed: () => contributions.mock.lastCall?.[1],
    reverted: () => revert.mock.lastCall?.[1],
    undone: () => undoRevert.mock.lastCall?.[1],
  };
  return { sent, actions, log: () => state.log, state: () => state, set: (log: object) => (state = update(state, { kind: "log", log })) };
}

const settled = (): Promise<void> => new Promise((resolve) => setTimeout(resolve, 0));

describe("the log panel", () => {
  it("lists the log, further pages and other robots", async () => {
    const { sent, actions, log } = started();
    actions.open();
    await settled();
    expect(log().entries).toHaveLength(1);
    actions.more();
    await settled();
    expect(sent.listed()).toEqual({ limit: 100, cursor: "7" });
    expect(log().entries).toHaveLength(2);
    actions.choose({ robot: "ada" });
    expect(log().entries).toBeNull();
    await settled();
    expect(sent.listed()).toEqual({ limit: 100, robot: "ada" });
    actions.close();
    expect(log().open).toBe(false);
  });

  it("takes out only what was tried out, with a reason, and says so", async () => {
    const { sent, actions, log, state, set } = started();
    actions.choose({ robot: "ada" });
    actions.confirm();
    actions.tryOut({ kind: "revert" });
    await settled();
    expect(shownPreview(state())[0]).toContain("1 contribution");
    actions.confirm();
    await settled();
    expect(sent.reverted(), "without a reason").toBeUndefined();
    set({ reason: " drift " });
    actions.confirm();
    await settled();
    expect(sent.reverted()).toEqual({ id: "id-1", robot: "ada", from: null, to: null, reason: "drift" });
    expect(log().preview).toBeNull();
    expect(log().done).toContain("1 contribution, at revision 10");
  });

  it("drops a preview when something else is meant", async () => {
    const { actions, log } = started();
    actions.tick("e", true);
    actions.tryOut({ kind: "revert" });
    await settled();
    expect(log().preview).not.toBeNull();
    actions.tick("f", true);
    expect(log().preview).toBeNull();
    actions.tryOut({ kind: "revert" });
    actions.tick("f", false);
    await settled();
    expect(log().preview, "its answer came too late").toBeNull();
    expect(log().busy).toBeNull();
  });

  it("sends the same revert under the same id after a failure, and says what failed", async () => {
    const problem = { detail: "The database does not answer." } as never;
    const revert = vi.fn<Api["revert"]>().mockRejectedValueOnce(new Refused(503, problem)).mockResolvedValue(REVERT);
    const { actions, log, set } = started({ revert });
    actions.tick("e", true);
    set({ reason: "drift" });
    actions.tryOut({ kind: "revert" });
    await settled();
    actions.confirm();
    await settled();
    expect(log().problem).toBe("The database does not answer.");
    actions.confirm();
    await settled();
    expect(revert.mock.calls.map(([, body]) => body.id)).toEqual(["id-1", "id-1"]);
    expect(log().problem).toBeNull();
  });

  it("puts back", async () => {
    const { sent, actions, log } = started();
    actions.tryOut({ kind: "undo", revert: "id-9" });
    await settled();
    actions.confirm();
    await settled();
    expect(sent.undone()).toBe("id-9");
    expect(log().done).toContain("revision 11");
  });
});

it("only editors and admins may take out", () => {
  const who = (scopes: never[]): State =>
    update(after(...ON_GROUND), { kind: "session", session: { kind: "in", who: { scopes } as never } });
  expect(mayRevert(who(["map:read" as never]))).toBe(false);
  expect(mayRevert(who(["map:edit" as never]))).toBe(true);
  expect(mayRevert(who(["admin" as never]))).toBe(true);
});
