import { describe, expect, it } from "vitest";
import { batchesOf } from "../src/map/batches";
import { xScreenFromLevel, yScreenFromLevel, type Frame, type Pen } from "../src/map/frame";
import { paintRaster } from "../src/map/paint_raster";
import { paintSegments } from "../src/map/paint_segments";
import type { Wanted } from "../src/map/pictures";
import { clearOf, type Label } from "../src/map/robot_labels";
import { LIGHT } from "../src/palette";
import { pictureKey, type PictureMark } from "../src/pyramid";
import { segment } from "./samples";

/** A pen that writes down what it is told: the names of calls with their numbers, and colours. */
function recordingPen(): { pen: Pen; calls: string[] } {
  const calls: string[] = [];
  const pen = new Proxy({} as Pen, {
    get: (_, name) =>
      (...args: unknown[]): void => {
        const numbers = args.filter((arg): arg is number => typeof arg === "number").map((value) => Number(value.toFixed(2)));
        calls.push(`${String(name)} ${numbers.join(" ")}`.trim());
      },
    set: (_, name, value) => {
      if (name === "strokeStyle") calls.push(`strokeStyle ${String(value)}`);
      return true;
    },
  });
  return { pen, calls };
}

/** 200 x 100 pixels of 0.1 m around the point (10, 5): x from 0 to 20, y from 0 to 10. */
function frame(pen: Pen): Frame {
  return { pen, widthPx: 200, heightPx: 100, centreLevel: [10, 5], resolution: 0.1, pixelRatio: 1 };
}

describe("a frame", () => {
  it("has y up in the level and down on the screen", () => {
    const { pen } = recordingPen();
    expect([xScreenFromLevel(frame(pen), 0), yScreenFromLevel(frame(pen), 0)]).toEqual([0, 100]);
    expect([xScreenFromLevel(frame(pen), 20), yScreenFromLevel(frame(pen), 10)]).toEqual([200, 0]);
  });
});

describe("batches", () => {
  const slots = new Map([["ada", 0], ["bo", 1]]);

  it("gather pieces by who saw them, with what several saw below", () => {
    const batches = batchesOf(
      [
        segment("a", { robots: ["bo"] }),
        segment("b", { robots: ["ada", "bo"] }),
        segment("c", { robots: ["ada"] }),
        segment("d", { robots: ["bo"], solid: [{ from_m: 0, to_m: 1, ends: ["jump", "jump"], existence_nat: 8.67 }, { from_m: 2, to_m: 3, ends: ["jump", "jump"], existence_nat: 8.67 }] }),
      ],
      slots,
    );
    expect(batches.map((batch) => [batch.slot, batch.ends.length / 4])).toEqual([[null, 1], [0, 1], [1, 3]]);
  });

  it("are painted where they are, in their colours", () => {
    const { pen, calls } = recordingPen();
    const painted = paintSegments(frame(pen), batchesOf([segment("a")], slots), LIGHT);
    expect(painted).toBe(1);
    expect(calls).toContain(`strokeStyle ${LIGHT.robots[0]}`);
    // The wall x = 2 from y = 1 to y = 4.
    expect(calls.slice(calls.indexOf("beginPath"))).toEqual(["beginPath", "moveTo 20 90", "lineTo 20 60", "stroke", "setLineDash"]);
  });

  it("are painted only where the screen is", () => {
    const { pen, calls } = recordingPen();
    const away = segment("a", { rho_m: 40 });
    expect(paintSegments(frame(pen), batchesOf([away], slots), LIGHT)).toBe(0);
    expect(calls.some((call) => call.startsWith("lineTo"))).toBe(false);
    // One that crosses the screen with both ends outside is there.
    const across = segment("b", { rho_m: 5, solid: [{ from_m: -50, to_m: 50, ends: ["jump", "jump"], existence_nat: 8.67 }] });
    expect(paintSegments(frame(pen), batchesOf([across], slots), LIGHT)).toBe(1);
  });

  it("are cut into strokes that a canvas can take", () => {
    const { pen, calls } = recordingPen();
    const many = Array.from({ length: 1000 }, (_, i) => segment(`s${i}`));
    expect(paintSegments(frame(pen), batchesOf(many, slots), LIGHT)).toBe(1000);
    expect(calls.filter((call) => call === "stroke").length).toBeGreaterThanOrEqual(4);
  });
});

describe("labels of robots", () => {
  const label = (xMiddlePx: number, topPx: number): Label => ({ name: "a", what: "b", colour: "#000000", xMiddlePx, topPx, widthPx: 100 });

  it("keep clear of each other", () => {
    const placed: Label[] = [];
    for (const wanted of [label(0, 0), label(10, 5), label(60, 30), label(500, 10), label(20, 0)]) {
      placed.push(clearOf(placed, wanted));
    }
    for (const [i, a] of placed.entries()) {
      for (const b of placed.slice(0, i)) {
        const apart = Math.abs(a.xMiddlePx - b.xMiddlePx) >= 100 || Math.abs(a.topPx - b.topPx) >= 33;
        expect(apart, JSON.stringify([a, b])).toBe(true);
      }
    }
    // Nobody is moved without need.
    expect(placed[0]?.topPx).toBe(0);
    expect(placed[3]?.topPx).toBe(10);
  });
});

describe("the raster", () => {
  // At 0.1 m a pixel and cells of 0.05 m, z is 5 and a picture 25.6 m wide.
  const there: PictureMark = { revision: 3, present: true };
  const paint = (held: readonly string[], marks: ReadonlyMap<string, PictureMark>): { calls: string[]; wanted: string[] } => {
    const { pen, calls } = recordingPen();
    let wanted: readonly Wanted[] = [];
    const image = {} as CanvasImageSource;
    paintRaster(frame(pen), {
      pictures: {
        want: (now) => {
          wanted = now;
        },
        get: (address) => (held.includes(pictureKey(address)) ? image : undefined),
        counts: () => ({ loaded: 0, pending: 0 }),
        clear: () => undefined,
      },
      marks: (z) => (z === 5 ? marks : new Map<string, PictureMark>()),
      cellM: 0.05,
      epoch: 1,
    });
    return { calls: calls.filter((call) => call.startsWith("drawImage")), wanted: wanted.map(({ address }) => pictureKey(address)) };
  };

  it("wants the pictures on the screen that there are, and no others", () => {
    expect(paint([], new Map([["5/-1/0", there], ["5/-2/0", there]])).wanted).toEqual(["5/-1/0"]);
    expect(paint([], new Map([["5/-1/0", { revision: 9, present: false }]])).wanted).toEqual([]);
  });

  it("is painted where it belongs", () => {
    expect(paint(["5/-1/0"], new Map([["5/-1/0", there]])).calls).toEqual(["drawImage 0 -156 256 256"]);
  });

  it("has a coarser picture stand in for one that has not come", () => {
    const { calls, wanted } = paint(["3/-1/0"], new Map([["5/-1/0", there]]));
    // A quarter of it each way: its lowest row of four, at the left.
    expect(calls).toEqual(["drawImage 0 192 64 64 0 -156 256 256"]);
    expect(wanted).toEqual(["5/-1/0"]);
  });

  it("has finer pictures stand in where there is no coarser one", () => {
    expect(paint(["6/-1/1"], new Map([["5/-1/0", there]])).calls).toEqual(["drawImage 128 -28 128 128"]);
  });
});
