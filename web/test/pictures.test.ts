import { beforeEach, describe, expect, it } from "vitest";
import { createPictures, type Pictures, type Wanted } from "../src/map/pictures";
import { pictureKey, type PictureAddress } from "../src/pyramid";

/** Loads that are answered by hand. */
interface Load {
  key: string;
  answer: (picture: string | null) => Promise<void>;
  fail: () => Promise<void>;
}

let loads: Load[];
let discarded: string[];
let redraws: number;
let retries: (() => void)[];
let pictures: Pictures<string>;

const settled = (): Promise<void> => new Promise((resolve) => setTimeout(resolve, 0));

beforeEach(() => {
  loads = [];
  discarded = [];
  redraws = 0;
  retries = [];
  pictures = createPictures<string>({
    load: (address) =>
      new Promise((resolve, reject) => {
        loads.push({
          key: pictureKey(address),
          answer: (picture) => {
            resolve(picture);
            return settled();
          },
          fail: () => {
            reject(new Error("no"));
            return settled();
          },
        });
      }),
    discard: (picture) => discarded.push(picture),
    onLoaded: () => redraws++,
    timers: {
      setTimeout: (run) => retries.push(run),
      clearTimeout: () => undefined,
    },
  });
});

const at = (col: number): PictureAddress => ({ z: 6, row: 0, col });
const wanted = (col: number, revision: number): Wanted => ({ address: at(col), mark: { revision, present: true } });

describe("pictures", () => {
  it("are fetched once", async () => {
    pictures.want([wanted(0, 3)], 1);
    pictures.want([wanted(0, 3)], 1);
    expect(loads.map((load) => load.key)).toEqual(["6/0/0"]);
    expect(pictures.counts()).toEqual({ loaded: 0, pending: 1 });
    await loads[0]?.answer("first");
    expect(pictures.get(at(0))).toBe("first");
    expect(pictures.counts()).toEqual({ loaded: 1, pending: 0 });
    expect(redraws).toBe(1);
    pictures.want([wanted(0, 3)], 1);
    expect(loads.length).toBe(1);
  });

  it("stay to be seen until the newer ones are there", async () => {
    pictures.want([wanted(0, 3)], 1);
    await loads[0]?.answer("old");
    pictures.want([wanted(0, 4)], 1);
    expect(loads.length).toBe(2);
    expect(pictures.get(at(0))).toBe("old");
    expect(pictures.counts().pending).toBe(1);
    await loads[1]?.answer("new");
    expect(pictures.get(at(0))).toBe("new");
    expect(discarded).toEqual(["old"]);
  });

  it("are fetched again if they changed while they were on their way", async () => {
    pictures.want([wanted(0, 3)], 1);
    pictures.want([wanted(0, 4)], 1);
    expect(loads.length).toBe(1);
    await loads[0]?.answer("old");
    expect(loads.length).toBe(2);
    expect(pictures.counts().pending).toBe(1);
  });

  it("of an earlier epoch are stale, whatever their revision", async () => {
    pictures.want([wanted(0, 30)], 1);
    await loads[0]?.answer("before");
    pictures.want([wanted(0, 2)], 2);
    expect(loads.length).toBe(2);
  });

  it("that did not change are not fetched when others do", async () => {
    pictures.want([wanted(0, 3), wanted(1, 3)], 1);
    await loads[0]?.answer("a");
    await loads[1]?.answer("b");
    pictures.want([wanted(0, 3), wanted(1, 7)], 1);
    expect(loads.map((load) => load.key)).toEqual(["6/0/0", "6/0/1", "6/0/1"]);
  });

  it("are fetched six at a time, the most important first", async () => {
    pictures.want(Array.from({ length: 9 }, (_, col) => wanted(col, 1)), 1);
    expect(loads.map((load) => load.key)).toEqual([0, 1, 2, 3, 4, 5].map((col) => `6/0/${col}`));
    await loads[0]?.answer("x");
    expect(loads.length).toBe(7);
  });

  it("that left the screen are not fetched any more", async () => {
    pictures.want(Array.from({ length: 9 }, (_, col) => wanted(col, 1)), 1);
    pictures.want([], 1);
    await loads[0]?.answer("x");
    expect(loads.length).toBe(6);
  });

  it("are tried again after a while when they failed", async () => {
    pictures.want([wanted(0, 3)], 1);
    await loads[0]?.fail();
    expect(loads.length).toBe(1);
    pictures.want([wanted(0, 3)], 1);
    expect(loads.length).toBe(1);
    retries[0]?.();
    expect(loads.length).toBe(2);
    await loads[1]?.answer("x");
    expect(pictures.get(at(0))).toBe("x");
  });

  it("where nothing is to be seen count as there", async () => {
    pictures.want([wanted(0, 3)], 1);
    await loads[0]?.answer(null);
    expect(pictures.get(at(0))).toBeUndefined();
    expect(pictures.counts()).toEqual({ loaded: 0, pending: 0 });
  });

  it("of a level that was left do not come back", async () => {
    pictures.want([wanted(0, 3)], 1);
    pictures.clear();
    await loads[0]?.answer("late");
    expect(pictures.get(at(0))).toBeUndefined();
    expect(discarded).toEqual(["late"]);
  });

  it("are not hoarded", async () => {
    for (let col = 0; col < 300; col++) {
      pictures.want([wanted(col, 1)], 1);
      await loads[col]?.answer(`p${col}`);
    }
    expect(pictures.counts().loaded).toBe(256);
    expect(discarded.slice(0, 2)).toEqual(["p0", "p1"]);
    expect(pictures.get(at(299))).toBe("p299");
  });
});
