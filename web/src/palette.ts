// Colours: one per robot, one for what several robots saw, for a light and a dark page.
//
// Six robots have colours of their own; they were searched for so that the least distance between
// any two (in Oklab), as seen with normal vision and under protanopia, deuteranopia and
// tritanopia, is as great as it can be while each has a contrast of 3 to 1 against the map's
// ground; orange comes last or not at all, as it is what the server's pictures show of sonar.
// Further robots repeat the colours with dashes. test/palette.test.ts measures all that.

/** How the lines of one robot are drawn. */
export interface Stroke {
  colour: string;
  /** Pattern of dashes in screen pixels; none if empty. */
  dash: readonly number[];
}

/** The colours of a page. */
export interface Theme {
  name: "light" | "dark";
  /** Ground of the map: what no robot has seen. */
  unknown: string;
  /** Colours of robots, by slot. */
  robots: readonly string[];
  /** What more than one robot saw. */
  several: string;
  /** Chains: the band beneath their walls, and the inside of polygons. */
  chain: string;
  /** The plan of the a-priori model. */
  model: string;
  /** What is drawn of the model and not in the draft yet. */
  drawn: string;
  /** What no longer fits, and what a point has snapped to. */
  clash: string;
  /** Landmarks. */
  landmark: string;
  /** What a robot that is not heard is drawn in. */
  silent: string;
  grid: string;
  gridAxis: string;
  gridText: string;
  /** Halo of what is chosen. */
  chosen: string;
  /** Ground of labels on the map, and their text. */
  label: string;
  labelText: string;
}

export const LIGHT: Theme = {
  name: "light",
  unknown: "#e6eaee",
  robots: ["#0072b2", "#cc3366", "#556600", "#9966ff", "#660077", "#1100bb"],
  several: "#1f2933",
  chain: "#0f8f7a",
  model: "#5b3a29",
  drawn: "#0b6aa8",
  clash: "#b34700",
  landmark: "#b3005e",
  silent: "#7b8794",
  grid: "rgba(31, 41, 51, 0.10)",
  gridAxis: "rgba(31, 41, 51, 0.38)",
  gridText: "#52606d",
  chosen: "rgba(255, 196, 0, 0.75)",
  label: "rgba(255, 255, 255, 0.88)",
  labelText: "#1f2933",
};

export const DARK: Theme = {
  name: "dark",
  unknown: "#12161b",
  robots: ["#56b4e9", "#ff5599", "#77ee77", "#9966ff", "#009966", "#e69f00"],
  several: "#f1f5f9",
  chain: "#3fd0b6",
  model: "#e3c9a8",
  drawn: "#6cb8ee",
  clash: "#ffb454",
  landmark: "#ff8ad0",
  silent: "#8b98a5",
  grid: "rgba(241, 245, 249, 0.10)",
  gridAxis: "rgba(241, 245, 249, 0.40)",
  gridText: "#9aa5b1",
  chosen: "rgba(255, 214, 10, 0.60)",
  label: "rgba(18, 22, 27, 0.85)",
  labelText: "#f1f5f9",
};

const DASHES: readonly (readonly number[])[] = [[], [7, 4], [2, 3]];

/** How what one robot saw is drawn, by the robot's slot. */
export function strokeOf(theme: Theme, slot: number): Stroke {
  const count = theme.robots.length;
  return {
    colour: theme.robots[slot % count] ?? theme.several,
    dash: DASHES[Math.floor(slot / count) % DASHES.length] ?? [],
  };
}

/** How what several robots saw is drawn. */
export function strokeOfSeveral(theme: Theme): Stroke {
  return { colour: theme.several, dash: [] };
}

/**
 * Slots for robots: who has one keeps it for as long as the page is open; new ones get the lowest
 * free slots in the order of their names.
 */
export function withSlots(slots: ReadonlyMap<string, number>, robots: Iterable<string>): ReadonlyMap<string, number> {
  const missing = [...new Set(robots)].filter((robot) => !slots.has(robot)).sort();
  if (missing.length === 0) return slots;
  const next = new Map(slots);
  const taken = new Set(slots.values());
  let free = 0;
  for (const robot of missing) {
    while (taken.has(free)) free++;
    taken.add(free);
    next.set(robot, free);
  }
  return next;
}
