// The tools on the map: what moving, clicking and dragging the pointer makes of what is being edited. Pure.

import { edited, shownObjects, type EditingState, type Tool } from "../editing";
import type { Point } from "../geometry";
import { boxBetween, chosenAfter, objectAt, objectsIn } from "./choosing";
import { doorwayIn, sizeIn } from "./doorways";
import type { Puts } from "./history";
import { middleOf, nameOf, placementOf, turned } from "./objects";
import { free, snap, type Snap } from "./snapping";
import { drawn, instanceAt, opened, pulled, shifted, withDoorways } from "./verbs";
import { axisOf, coordinatesOn, endsOf, isSamePlace, lengthOf, nearestWall, placeOn, wallOf, wallsAmong, type Wall } from "./walls";

/** The pointer over the map. */
export interface Pointer {
  at: Point;
  /** Metres per pixel. */
  resolution: number;
  isTouch: boolean;
  /** Adds to what is chosen (shift). */
  several: boolean;
  /** Without snapping (alt). */
  loose: boolean;
}

/** What the tools need from outside. */
export interface Hand {
  uuid: () => string;
}

const MOUSE_PX = 10;
const FINGER_PX = 22;
/** The identity of what would come to be, before it is made. */
export const GHOST = "ghost";

export function withinPx({ isTouch }: Pick<Pointer, "isTouch">): number {
  return isTouch ? FINGER_PX : MOUSE_PX;
}

function snapped(editing: EditingState, pointer: Pointer, options: { walls?: Iterable<Wall>; ends?: readonly Point[]; from?: Point | null } = {}): Snap {
  if (pointer.loose || editing.copy === null) return free(pointer.at);
  const walls = options.walls ?? wallsAmong(editing.copy.now).values();
  return snap(pointer.at, {
    resolution: pointer.resolution,
    withinPx: withinPx(pointer),
    walls,
    ends: options.ends ?? [],
    from: options.from ?? null,
    gridM: editing.making.gridM,
  });
}

/** With another tool at hand; what the old one was in the middle of is finished or dropped. */
export function withTool(editing: EditingState, tool: Tool, hand: Hand): Partial<EditingState> {
  const prototype = editing.making.prototype ?? [...editing.library.keys()].at(0) ?? null;
  // Things are drawn on the map.
  return { ...finished(editing, hand), tool, is3d: editing.is3d && tool === "select", making: { ...editing.making, prototype } };
}

/** The pointer has moved with nothing pressed. */
export function hovered(editing: EditingState, pointer: Pointer): Partial<EditingState> {
  const { copy, sketch, tool } = editing;
  if (copy === null || tool === "select") return {};
  if (tool === "wall") return sketch.kind === "walls" ? { sketch: { ...sketch, snap: snapForWall(editing, pointer) } } : { sketch: { kind: "hover", snap: snapped(editing, pointer), puts: new Map() } };
  return { sketch: { kind: "hover", ...landing(editing, pointer, { uuid: () => GHOST }) } };
}

/** The pointer has left the map. */
export function left({ sketch }: EditingState): Partial<EditingState> {
  if (sketch.kind === "hover") return { sketch: { kind: "none" } };
  return sketch.kind === "walls" ? { sketch: { ...sketch, snap: null } } : {};
}

function snapForWall(editing: EditingState, pointer: Pointer): Snap {
  const { sketch } = editing;
  if (sketch.kind !== "walls") return snapped(editing, pointer);
  const walls = editing.copy === null ? [] : [...wallsAmong(editing.copy.now).values()];
  return snapped(editing, pointer, { walls: [...walls, ...drafted(editing, sketch.points)], ends: sketch.points.slice(0, 1), from: sketch.points.at(-1) ?? null });
}

/** The walls of a line that is still being drawn. */
function drafted({ making }: EditingState, points: readonly Point[]): Wall[] {
  return points.slice(1).map((b, index) => ({ a: points[index] ?? b, b, thicknessM: making.thicknessM, lowerM: 0, upperM: making.wallHeightM }));
}

/** Where a doorway or an instance would come to be. */
function landing(editing: EditingState, pointer: Pointer, hand: Hand): { snap: Snap | null; puts: Puts } {
  const { copy, making, tool, library } = editing;
  if (copy === null) return { snap: null, puts: new Map() };
  if (tool === "doorway") {
    const found = nearestWall(wallsAmong(copy.now), pointer.at, 2 * withinPx(pointer) * pointer.resolution);
    if (found === null) return { snap: free(pointer.at), puts: new Map() };
    const alongM = inSteps(found.wall, coordinatesOn(found.wall, pointer.at).alongM, making.doorWidthM, editing, pointer);
    const puts = opened(found.wall, alongM, { widthM: making.doorWidthM, heightM: making.doorHeightM }, hand.uuid);
    return { snap: { at: placeOn(found.wall, alongM), kind: "wall", guide: axisOf(found.wall) }, puts };
  }
  if (making.prototype === null || !library.has(making.prototype)) return { snap: free(pointer.at), puts: new Map() };
  const at = snapped(editing, pointer);
  return { snap: at, puts: new Map([[hand.uuid(), instanceAt(making.prototype, library, at.at, making.yawRad)]]) };
}

/** A doorway's middle in the middle of its wall, if it is near; else with its nearer edge in whole steps of the grid from the wall's end. */
function inSteps(wall: Wall, alongM: number, widthM: number, { making: { gridM } }: EditingState, pointer: Pointer): number {
  if (pointer.loose) return alongM;
  const length = lengthOf(wall);
  if (Math.abs(alongM - length / 2) <= withinPx(pointer) * pointer.resolution) return length / 2;
  if (gridM === null) return alongM;
  return Math.round((alongM - widthM / 2) / gridM) * gridM + widthM / 2;
}

/** A click, or a tap. */
export function clicked(editing: EditingState, pointer: Pointer, hand: Hand): Partial<EditingState> {
  const { copy, tool, library, chosen } = editing;
  if (copy === null) return {};
  switch (tool) {
    case "select": {
      const id = objectAt(copy.now, library, pointer.at, (withinPx(pointer) * pointer.resolution) / 2);
      return { chosen: chosenAfter(chosen, id, pointer.several || editing.several) };
    }
    case "wall":
      return pointAdded(editing, snapForWall(editing, pointer).at, hand);
    case "doorway": {
      const { puts } = landing(editing, pointer, hand);
      if (puts.size === 0) return { problem: "A doorway goes into a wall: click on one." };
      return edited(editing, "put a doorway", puts, puts.keys());
    }
    case "prototype": {
      const { puts } = landing(editing, pointer, hand);
      if (puts.size === 0) return { problem: "The site has no prototypes yet: they come with its library." };
      return edited(editing, `place ${editing.making.prototype ?? "an object"}`, puts, puts.keys());
    }
  }
}

/** A place for the walls being drawn: on the first one they close, on the last one they end. */
export function pointAdded(editing: EditingState, at: Point, hand: Hand): Partial<EditingState> {
  const { sketch } = editing;
  if (sketch.kind !== "walls") return { sketch: { kind: "walls", points: [at], snap: null }, done: null, problem: null };
  const [first, last] = [sketch.points.at(0), sketch.points.at(-1)];
  if (last !== undefined && isSamePlace(last, at)) return finished(editing, hand);
  const next = { ...sketch, points: [...sketch.points, at], snap: null };
  const closes = first !== undefined && sketch.points.length > 2 && isSamePlace(first, at);
  return closes ? finished({ ...editing, sketch: next }, hand) : { sketch: next };
}

/** What the tool was in the middle of becomes an edit: the walls that are drawn so far. */
export function finished(editing: EditingState, hand: Hand): Partial<EditingState> {
  const { sketch, copy, making } = editing;
  if (sketch.kind !== "walls" || copy === null || sketch.points.length < 2) return { sketch: { kind: "none" } };
  const puts = drawn(copy.now, sketch.points, { thicknessM: making.thicknessM, heightM: making.wallHeightM }, hand.uuid);
  const fresh = [...puts.keys()].filter((id) => !copy.now.has(id));
  return edited(editing, fresh.length === 1 ? "draw a wall" : `draw ${fresh.length} walls`, puts, fresh);
}

/** Takes back the last place of walls being drawn. */
export function pointDropped({ sketch }: EditingState): Partial<EditingState> {
  if (sketch.kind !== "walls") return {};
  const points = sketch.points.slice(0, -1);
  return { sketch: points.length === 0 ? { kind: "none" } : { ...sketch, points } };
}

/** The place for which an end of the only chosen wall is grasped; null if none is near. */
export function graspedEnd({ copy, chosen }: EditingState, pointer: Pointer): Point | null {
  const [only] = chosen;
  const object = only === undefined || chosen.size !== 1 ? undefined : copy?.now.get(only);
  const wall = object === undefined ? null : wallOf(object);
  if (wall === null) return null;
  const reach = withinPx(pointer) * pointer.resolution;
  return endsOf(wall).find(([x, y]) => Math.hypot(x - pointer.at[0], y - pointer.at[1]) <= reach) ?? null;
}

/** The pointer goes down: whether a drag of objects or of a box begins. Null leaves the map to be moved. */
export function grasped(editing: EditingState, pointer: Pointer): Partial<EditingState> | null {
  const { copy, library, tool, chosen } = editing;
  if (copy === null || tool !== "select") return null;
  const end = graspedEnd(editing, pointer);
  if (end !== null) return { sketch: { kind: "drag", from: pointer.at, end, snap: null, puts: new Map() } };
  const id = objectAt(copy.now, library, pointer.at, (withinPx(pointer) * pointer.resolution) / 2);
  const several = pointer.several || editing.several;
  if (id === null) return several ? { sketch: { kind: "box", from: pointer.at, to: pointer.at } } : null;
  // A finger moves the map unless what it touches is chosen.
  if (!chosen.has(id) && pointer.isTouch) return null;
  return {
    chosen: chosen.has(id) ? chosen : several ? new Set([...chosen, id]) : new Set([id]),
    sketch: { kind: "drag", from: pointer.at, end: null, snap: null, puts: new Map() },
  };
}

/** The pointer moves while it is down. */
export function dragged(editing: EditingState, pointer: Pointer): Partial<EditingState> {
  const { copy, sketch, chosen } = editing;
  if (copy === null) return {};
  if (sketch.kind === "box") return { sketch: { ...sketch, to: pointer.at } };
  if (sketch.kind !== "drag") return {};
  if (sketch.end !== null) {
    const { end } = sketch;
    const others = [...wallsAmong(copy.now).values()];
    const still = others.filter(({ a, b }) => !isSamePlace(a, end) && !isSamePlace(b, end));
    const [only] = chosen;
    const wall = only === undefined ? null : wallOf(copy.now.get(only) ?? { kind: "other" });
    const from = wall === null ? null : isSamePlace(wall.a, end) ? wall.b : wall.a;
    const to = snapped(editing, pointer, { walls: still, from });
    const puts = pulled(copy.now, end, to.at);
    return puts === null ? {} : { sketch: { ...sketch, snap: to, puts } };
  }
  return { sketch: { ...sketch, ...carried(editing, sketch.from, pointer) } };
}

/** What is chosen, dragged from a place to the pointer. */
function carried(editing: EditingState, from: Point, pointer: Pointer): { snap: Snap; puts: Puts } {
  const { copy, chosen } = editing;
  const by: Point = [pointer.at[0] - from[0], pointer.at[1] - from[1]];
  if (copy === null) return { snap: free(pointer.at), puts: new Map() };
  const slid = chosen.size === 1 ? slidingDoorway(editing, by, pointer) : null;
  if (slid !== null) return slid;
  const all = withDoorways(copy.now, chosen);
  const still = [...wallsAmong(copy.now)].filter(([id]) => !all.has(id)).map(([, wall]) => wall);
  // The place of what is dragged that lies nearest to where it was grasped lands on what is near.
  const anchor = anchorOf(editing, from);
  const target = snapped(editing, { ...pointer, at: [anchor[0] + by[0], anchor[1] + by[1]] }, { walls: still });
  return { snap: target, puts: shifted(copy.now, chosen, [target.at[0] - anchor[0], target.at[1] - anchor[1]]) };
}

function anchorOf({ copy, chosen }: EditingState, from: Point): Point {
  let [best, least] = [from, Infinity];
  for (const id of chosen) {
    const object = copy?.now.get(id);
    if (object === undefined) continue;
    const wall = wallOf(object);
    const [x, y] = placementOf(object).position;
    for (const place of wall === null ? [[x, y] as const] : endsOf(wall)) {
      const distance = Math.hypot(place[0] - from[0], place[1] - from[1]);
      if (distance < least) [best, least] = [place, distance];
    }
  }
  return best;
}

/** A doorway dragged along its wall, or into another one. */
function slidingDoorway(editing: EditingState, by: Point, pointer: Pointer): { snap: Snap; puts: Puts } | null {
  const { copy, chosen, library } = editing;
  const [id] = chosen;
  const doorway = id === undefined ? undefined : copy?.now.get(id);
  const middle = doorway?.kind === "doorway" ? middleOf([doorway], library) : null;
  if (copy === null || id === undefined || doorway === undefined || middle === null) return null;
  const to: Point = [middle[0] + by[0], middle[1] + by[1]];
  const found = nearestWall(wallsAmong(copy.now), to, 2 * withinPx(pointer) * pointer.resolution);
  if (found === null) return null;
  const old = nearestWall(wallsAmong(copy.now), middle, 0);
  const { widthM, heightM } = sizeIn(old?.wall ?? found.wall, doorway);
  const alongM = inSteps(found.wall, coordinatesOn(found.wall, to).alongM, widthM, editing, pointer);
  const puts: Puts = new Map([[id, doorwayIn(found.wall, alongM, { widthM, heightM }, doorway)]]);
  return { snap: { at: placeOn(found.wall, alongM), kind: "wall", guide: axisOf(found.wall) }, puts };
}

/** The pointer goes up. */
export function released(editing: EditingState): Partial<EditingState> {
  const { copy, sketch, chosen, library } = editing;
  if (copy === null) return {};
  if (sketch.kind === "box") {
    const inside = objectsIn(copy.now, library, boxBetween(sketch.from, sketch.to));
    return { sketch: { kind: "none" }, chosen: new Set([...chosen, ...inside]) };
  }
  if (sketch.kind !== "drag") return {};
  return edited(editing, sketch.end === null ? `move ${whatIsChosen(editing)}` : "move a corner", sketch.puts);
}

/** What is chosen, in words. */
export function whatIsChosen(editing: EditingState): string {
  const { chosen } = editing;
  const [only] = chosen;
  if (only === undefined || chosen.size !== 1) return chosen.size === 0 ? "nothing" : `${chosen.size} objects`;
  return nameOf(shownObjects(editing).get(only));
}

/** The ghost of an instance turned on the spot, before it is placed. */
export function ghostTurned(editing: EditingState, byRad: number): Partial<EditingState> {
  const { sketch, making } = editing;
  const yawRad = making.yawRad + byRad;
  const next = { making: { ...making, yawRad } };
  const at = sketch.kind === "hover" ? sketch.snap?.at : undefined;
  const ghost = sketch.kind === "hover" ? sketch.puts.get(GHOST) : undefined;
  if (sketch.kind !== "hover" || at === undefined || ghost == null) return next;
  return { ...next, sketch: { ...sketch, puts: new Map([[GHOST, turned(ghost, at, byRad)]]) } };
}
