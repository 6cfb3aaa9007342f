import { describe, expect, it } from "vitest";
import { DARK, LIGHT, strokeOf, strokeOfSeveral, withSlots } from "../src/palette";

type Triple = readonly [number, number, number];
type Table = readonly [Triple, Triple, Triple];

/** How colours look to people: Machado, Oliveira and Fernandes 2009, severity 1, on linear RGB. */
const SIGHT: Readonly<Record<string, Table>> = {
  normal: [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
  protanopia: [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
  deuteranopia: [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.01182, 0.04294, 0.968881]],
  tritanopia: [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.3039]],
};

function times(table: Table, v: Triple): Triple {
  const row = (r: Triple): number => r[0] * v[0] + r[1] * v[1] + r[2] * v[2];
  return [row(table[0]), row(table[1]), row(table[2])];
}

function linear(hex: string): Triple {
  const channel = (at: number): number => {
    const value = parseInt(hex.slice(at, at + 2), 16) / 255;
    return value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
  };
  return [channel(1), channel(3), channel(5)];
}

/** Ottosson 2020. */
function oklab(rgb: Triple): Triple {
  const lms = times([[0.4122214708, 0.5363325363, 0.0514459929], [0.2119034982, 0.6806995451, 0.1073969566], [0.0883024619, 0.2817188376, 0.6299787005]], rgb);
  return times(
    [[0.2104542553, 0.793617785, -0.0040720468], [1.9779984951, -2.428592205, 0.4505937099], [0.0259040371, 0.7827717662, -0.808675766]],
    [Math.cbrt(lms[0]), Math.cbrt(lms[1]), Math.cbrt(lms[2])],
  );
}

function difference(a: string, b: string, sight: Table): number {
  const seen = (hex: string): Triple => {
    const [red, green, blue] = times(sight, linear(hex));
    const clamp = (value: number): number => Math.min(1, Math.max(0, value));
    return oklab([clamp(red), clamp(green), clamp(blue)]);
  };
  const [p, q] = [seen(a), seen(b)];
  return Math.hypot(p[0] - q[0], p[1] - q[1], p[2] - q[2]);
}

/** WCAG 2.2, contrast ratio. */
function contrast(a: string, b: string): number {
  const luminance = (hex: string): number => {
    const [red, green, blue] = linear(hex);
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue + 0.05;
  };
  return Math.max(luminance(a), luminance(b)) / Math.min(luminance(a), luminance(b));
}

/** Free space in the server's pictures, on a dark page turned over by style/colours.css. */
const FREE = { light: "#f3f6fa", dark: "#323437" };

describe.each([LIGHT, DARK])("the $name palette", (theme) => {
  it.each(Object.entries(SIGHT))("can be told apart under %s", (_, sight) => {
    const colours = [...theme.robots, theme.several];
    const least = Math.min(
      ...colours.flatMap((a, i) => colours.slice(0, i).map((b) => difference(a, b, sight))),
    );
    // 0.02 is just noticeable side by side; lines far from each other need several times that.
    expect(least).toBeGreaterThan(0.1);
  });

  it("stands out from the ground (WCAG 2.2, 1.4.11: 3 to 1)", () => {
    for (const colour of [...theme.robots, theme.several, theme.silent]) {
      expect(contrast(colour, theme.unknown)).toBeGreaterThan(3);
      expect(contrast(colour, FREE[theme.name])).toBeGreaterThan(3);
    }
  });

  it("has readable labels (WCAG 2.2, 1.4.3: 4.5 to 1)", () => {
    expect(contrast(theme.gridText, theme.unknown)).toBeGreaterThan(4.5);
  });
});

describe("strokes", () => {
  it("differ for eighteen robots, and from what several saw", () => {
    const looks = Array.from({ length: 18 }, (_, slot) => JSON.stringify(strokeOf(LIGHT, slot)));
    looks.push(JSON.stringify(strokeOfSeveral(LIGHT)));
    expect(new Set(looks).size).toBe(19);
  });

  it("exist for any number of robots", () => {
    expect(strokeOf(LIGHT, 18)).toEqual(strokeOf(LIGHT, 0));
  });
});

describe("slots", () => {
  it("go to new robots by name, lowest first", () => {
    expect([...withSlots(new Map(), ["c", "a", "b", "a"])]).toEqual([["a", 0], ["b", 1], ["c", 2]]);
  });

  it("stay with those who have one", () => {
    const slots = withSlots(new Map([["z", 1]]), ["a", "b", "z"]);
    expect(Object.fromEntries(slots)).toEqual({ z: 1, a: 0, b: 2 });
  });

  it("are the same object if nobody is new", () => {
    const slots = new Map([["a", 0]]);
    expect(withSlots(slots, ["a"])).toBe(slots);
  });
});
