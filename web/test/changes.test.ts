import { describe, expect, it } from "vitest";
import { changeInWords, evidenceInWords, middleOf, NO_CHANGES, sorted, waiting } from "../src/changes";
import { xScreenFromLevel, yScreenFromLevel, type Frame, type Pen } from "../src/map/frame";
import { paintChanges } from "../src/map/paint_changes";
import { LIGHT } from "../src/palette";
import type { ModelChange } from "../src/wire";
import { NOON_MS } from "./samples";

function change(fields: Partial<ModelChange> = {}): ModelChange {
  return {
    id: "missing:a", kind: "missing", state: "open", object: "a", object_kind: "machine", name: "lathe", probed_m: 3.2, through_m: 3,
    hull_m: [[4, 4], [6, 4], [6, 6], [4, 6]], segments: [], clusters: [], looks: 0, robots: [], ...fields,
  };
}

describe("a change in words", () => {
  it("says what has become of what", () => {
    expect(changeInWords(change())).toBe("lathe is not there");
    expect(changeInWords(change({ kind: "new", object: null, object_kind: null, name: "" }))).toBe("a thing of 2.83 m that the model does not know");
    expect(changeInWords(change({ kind: "moved", name: "", motion: { x_m: 1, y_m: 0, heading_rad: 0.1, distance_m: 0.5 } }))).toBe("machine stands 50 cm away, turned by 6°");
    expect(changeInWords(change({ kind: "opened", stretches: [{ from_m: [0, 0], to_m: [0.9, 0], depth_m: 0.1 }] }))).toBe("lathe is open over 90 cm");
  });

  it("says what speaks for it, and what was answered", () => {
    expect(evidenceInWords(change(), NOON_MS)).toBe("seen through over 3 m of 3.2 m");
    const seen = { looks: 4, robots: ["ada", "bo"], last_seen: new Date(NOON_MS - 90_000).toISOString(), through_m: 0 };
    expect(evidenceInWords(change(seen), NOON_MS)).toBe("4 looks by ada and bo · last 1 min ago");
    const dismissal = { author: "mia", at: "2026-11-22T11:00:00Z", comment: "at repair" };
    expect(evidenceInWords(change({ state: "dismissed", through_m: 0, dismissal }), NOON_MS)).toBe("dismissed by token mia: at repair");
    expect(evidenceInWords(change({ state: "accepted", through_m: 0 }), NOON_MS)).toBe("in the draft, to be published");
  });

  it("counts those that wait", () => {
    expect(waiting(NO_CHANGES)).toBe("Asking what robots found …");
    expect(waiting({ ...NO_CHANGES, list: [] })).toBe("Nothing is published to hold the map against.");
    expect(waiting({ ...NO_CHANGES, list: [change({ state: "dismissed" })], publication: 3 })).toBe("Robots found nothing that waits for an answer.");
    expect(waiting({ ...NO_CHANGES, list: [change()], publication: 3 })).toBe("1 change waits for an answer.");
  });
});

describe("changes", () => {
  it("are listed with those first that wait for an answer", () => {
    const list = [change({ id: "c", state: "dismissed" }), change({ id: "b" }), change({ id: "d", state: "accepted" }), change({ id: "a" })];
    expect(sorted(list).map(({ id }) => id)).toEqual(["a", "b", "d", "c"]);
  });

  it("are shown at the middle of where they are", () => {
    expect(middleOf(change())).toEqual([5, 5]);
    expect(middleOf(change({ hull_m: [] }))).toBeNull();
  });

  it("that moved have an arrow from where the model has them, whatever the turn", () => {
    const lines: string[] = [];
    let from = "";
    const pen = new Proxy({} as Pen, {
      get: (_, name) => (x: number, y: number): void => {
        if (name === "moveTo") from = `${x.toFixed(1)},${y.toFixed(1)}`;
        if (name === "lineTo") lines.push(`${from} to ${x.toFixed(1)},${y.toFixed(1)}`);
      },
      set: () => true,
    });
    const frame: Frame = { pen, widthPx: 200, heightPx: 100, centreLevel: [10, 5], resolution: 0.1, pixelRatio: 1 };
    // A quarter turn about the origin and 10 m to the right: (5, 5) was (5, 5) turned back, that is (5, 5) -> (-5, 5) -> (5, 5).
    const moved = change({ kind: "moved", motion: { x_m: 10, y_m: 0, heading_rad: Math.PI / 2, distance_m: 0 } });
    expect(paintChanges(frame, [moved], LIGHT)).toBe(1);
    const at = (x: number, y: number): string => `${xScreenFromLevel(frame, x).toFixed(1)},${yScreenFromLevel(frame, y).toFixed(1)}`;
    expect(lines).toContain(`${at(5, 5)} to ${at(5, 5)}`);
    lines.length = 0;
    const shifted = change({ kind: "moved", motion: { x_m: 3, y_m: 1, heading_rad: 0, distance_m: 3.2 } });
    paintChanges(frame, [shifted], LIGHT);
    expect(lines).toContain(`${at(2, 4)} to ${at(5, 5)}`);
    expect(paintChanges(frame, [change({ hull_m: [[500, 500]] })], LIGHT)).toBe(0);
  });
});
