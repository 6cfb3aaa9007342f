import { describe, expect, it } from "vitest";
import { boundsOfPlan, isRead, NO_MODEL, withTable } from "../src/model";
import { pick } from "../src/pick";
import { describe as inWords } from "../src/panels/selection_card";
import { update, type State } from "../src/state";
import { createMockModel } from "./mock/model.mjs";
import { after, ON_GROUND } from "./samples";

const mock = createMockModel({ nowMs: () => 0 });
mock.enter("edit");
mock.enter("publication");
const plan = mock.plan(0.3, "published");
const landmarks = new Map(mock.landmarks(0.3).landmarks.map((landmark) => [landmark.id, landmark]));

/** The ground floor with a model that was read. */
function withModel(): State {
  const read = update(after(...ON_GROUND), { kind: "model", model: { revision: 2001, readAs: NO_MODEL.view, plan, landmarks } });
  return update(read, { kind: "layer", name: "landmarks", setting: { on: true } });
}

describe("the a-priori model", () => {
  it("is read again after an edit, and at another height", () => {
    const read = { ...NO_MODEL, revision: 7, readAs: NO_MODEL.view };
    expect(isRead(read, 7)).toBe(true);
    expect(isRead(read, 8)).toBe(false);
    expect(isRead({ ...read, view: { heightM: 1, state: "published" } }, 7)).toBe(false);
    expect(isRead(NO_MODEL, 0)).toBe(false);
  });

  it("has the bounds of its outlines and sheets, and none without any", () => {
    expect(boundsOfPlan(plan)).toEqual([25.8, -0.2, 34.2, 5.2]);
    expect(boundsOfPlan(null)).toBeNull();
    expect(boundsOfPlan(plan === null ? null : { ...plan, outlines: [], sheets: [] })).toBeNull();
  });

  it("finds the landmark nearest to a place", () => {
    // Lines and landmarks are met within 8 pixels: 20 cm.
    expect(pick(withModel(), [28.1, 1.4], 0.025)).toEqual({ kind: "landmark", id: "end" });
    expect(pick(withModel(), [28.1, 1.1], 0.025)?.kind).not.toBe("landmark");
  });

  it("follows what changes of the landmarks, and tells those that robots taught apart", () => {
    const told = withTable(new Map(), mock.landmarks(0.3));
    expect([told.told, told.landmarks.size]).toEqual([2000, 4]);
    const moved = [...told.landmarks.values()].filter(({ id }) => id === "learned").map((one) => ({ ...one, at_m: [31.1, 2.5] as [number, number] }));
    const next = withTable(told.landmarks, { ...mock.landmarks(0.3), revision: 2003, landmarks: moved, removed: ["door", "never-told"] });
    expect([...next.landmarks.keys()]).toEqual(["corner", "end", "learned"]);
    expect([next.told, next.landmarks.get("learned")?.at_m]).toEqual([2003, [31.1, 2.5]]);
    const chosen = update(withModel(), { kind: "select", selection: { kind: "landmark", id: "learned" } });
    expect(inWords(chosen)?.lines).toContainEqual(["Quality", "4 looks"]);
  });

  it("keeps the height with another level, and forgets the rest", () => {
    const state = update(withModel(), { kind: "model-view", view: { heightM: 1.2 } });
    const elsewhere = update(state, { kind: "place", place: { site: "plant", level: "upper" } });
    expect(elsewhere.model).toEqual({ ...NO_MODEL, view: { heightM: 1.2, state: "published" } });
  });

  it("tells of a landmark that is chosen, until it is gone", () => {
    const state = withModel();
    const selection = pick(state, [29.45, 0.05], 0.02);
    expect(selection).toEqual({ kind: "landmark", id: "door" });
    const chosen = update(state, { kind: "select", selection });
    expect(inWords(chosen)?.lines).toContainEqual(["What", "doorway"]);
    expect(inWords(chosen)?.lines).toContainEqual(["Width", "90 cm"]);
    expect(update(chosen, { kind: "model", model: { landmarks: new Map() } }).selection).toBeNull();
    const hidden = update(state, { kind: "layer", name: "landmarks", setting: { on: false } });
    expect(pick(hidden, [29.45, 0.05], 0.02)?.kind).not.toBe("landmark");
  });
});
