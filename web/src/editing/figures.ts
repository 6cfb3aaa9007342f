// The figures of what is chosen or about to be drawn, as people read and type them, and what typing one does. Pure.

import { edited, type EditingState, type Making } from "../editing";
import type { Point } from "../geometry";
import { doorwayIn, hostOf, middleOfDoorway, sizeIn, type DoorwaySize } from "./doorways";
import type { Puts } from "./history";
import { isUpright, placementOf, turned, uprightAt, yawOf } from "./objects";
import { pointAdded, type Hand } from "./pointing";
import { pulled, reshaped, shifted, withDoorways, WALL_LEAST_M } from "./verbs";
import { angleOf, coordinatesOn, lengthOf, wallOf, wallsAmong, type Wall } from "./walls";

/** One figure. */
export interface Figure {
  id: string;
  label: string;
  unit: "m" | "cm" | "°";
  /** In the unit; null if there is none yet. */
  value: number | null;
  min?: number;
  step: number;
  /** What typing a value does. */
  set: (editing: EditingState, value: number) => Partial<EditingState>;
}

const RAD = Math.PI / 180;

/** The figures that the bar shows. */
export function figuresOf(editing: EditingState): Figure[] {
  const { tool } = editing;
  if (tool === "wall") return [making("thicknessM", "Thickness", "cm"), making("wallHeightM", "Height", "m")].map((make) => make(editing));
  if (tool === "doorway") return [making("doorWidthM", "Width", "m"), making("doorHeightM", "Height", "m")].map((make) => make(editing));
  if (tool === "prototype") return [yawOfNext(editing)];
  const { copy, chosen } = editing;
  const [id] = chosen;
  const object = id === undefined || chosen.size !== 1 ? undefined : copy?.now.get(id);
  if (copy === null || id === undefined || object === undefined) return [];
  const wall = wallOf(object);
  if (wall !== null) return wallFigures(id, wall);
  if (object.kind === "doorway") {
    const walls = wallsAmong(copy.now);
    const host = walls.get(hostOf(object, walls) ?? "");
    if (host !== undefined) return doorwayFigures(id, host, sizeIn(host, object), coordinatesOn(host, middleOfDoorway(object) ?? host.a).alongM);
  }
  const [x, y, z] = placementOf(object).position;
  const at = (axis: "x" | "y", value: number): Figure => ({
    id: axis,
    label: axis,
    unit: "m",
    value,
    step: 0.05,
    set: (now, to) => put(now, "move", (objects) => shifted(objects, [id], axis === "x" ? [to - x, 0] : [0, to - y])),
  });
  const turn: Figure = {
    id: "yaw",
    label: "Turned",
    unit: "°",
    value: inDegrees(yawOf(object)),
    step: 15,
    set: (now, to) => put(now, "turn", () => new Map([[id, turned(object, [x, y], to * RAD - yawOf(object))]])),
  };
  const up: Figure = {
    id: "z",
    label: "Above floor",
    unit: "m",
    value: z,
    step: 0.05,
    set: (now, to) => put(now, "move", () => new Map([[id, { ...object, placement: { ...uprightAt([x, y], 0, to), ...(object.placement?.rotation == null ? {} : { rotation: object.placement.rotation }) } }]])),
  };
  return isUpright(object) ? [at("x", x), at("y", y), turn, up] : [at("x", x), at("y", y), up];
}

function inDegrees(rad: number): number {
  const value = Math.round((rad / RAD) * 1e4) / 1e4;
  return ((((value + 180) % 360) + 360) % 360) - 180;
}

function put(editing: EditingState, label: string, puts: (objects: NonNullable<EditingState["copy"]>["now"]) => Puts | null): Partial<EditingState> {
  if (editing.copy === null) return {};
  const made = puts(editing.copy.now);
  return made === null ? { problem: "The wall would be too short." } : edited(editing, label, made);
}

function making(key: "thicknessM" | "wallHeightM" | "doorWidthM" | "doorHeightM", label: string, unit: "m" | "cm"): (editing: EditingState) => Figure {
  const factor = unit === "cm" ? 100 : 1;
  return (editing) => ({
    id: key,
    label,
    unit,
    value: Math.round(editing.making[key] * factor * 1e4) / 1e4,
    min: unit === "cm" ? 1 : 0.1,
    step: unit === "cm" ? 1 : 0.05,
    set: (now, to) => ({ making: { ...now.making, [key]: to / factor } satisfies Making }),
  });
}

function yawOfNext({ making: { yawRad } }: EditingState): Figure {
  return { id: "yaw", label: "Turned", unit: "°", value: inDegrees(yawRad), step: 15, set: (now, to) => ({ making: { ...now.making, yawRad: to * RAD } }) };
}

function wallFigures(id: string, wall: Wall): Figure[] {
  const towards = (length: number, angle: number): Point => [wall.a[0] + length * Math.cos(angle), wall.a[1] + length * Math.sin(angle)];
  const shape = (label: string, next: Wall) => (now: EditingState) => put(now, label, (objects) => reshaped(objects, new Map([[id, next]])));
  return [
    { id: "length", label: "Length", unit: "m", value: rounded(lengthOf(wall)), min: WALL_LEAST_M, step: 0.05, set: (now, to) => put(now, "set the length of a wall", (objects) => pulled(objects, wall.b, towards(to, angleOf(wall)))) },
    { id: "angle", label: "Angle", unit: "°", value: inDegrees(angleOf(wall)), step: 15, set: (now, to) => put(now, "set the direction of a wall", (objects) => pulled(objects, wall.b, towards(lengthOf(wall), to * RAD))) },
    { id: "thickness", label: "Thickness", unit: "cm", value: rounded(wall.thicknessM * 100), min: 1, step: 1, set: (now, to) => shape("set the thickness of a wall", { ...wall, thicknessM: to / 100 })(now) },
    { id: "height", label: "Height", unit: "m", value: rounded(wall.upperM - wall.lowerM), min: 0.1, step: 0.05, set: (now, to) => shape("set the height of a wall", { ...wall, upperM: wall.lowerM + to })(now) },
  ];
}

function doorwayFigures(id: string, host: Wall, size: DoorwaySize, alongM: number): Figure[] {
  const shape = (label: string, along: number, next: DoorwaySize) => (now: EditingState) =>
    put(now, label, (objects) => {
      const doorway = objects.get(id);
      return doorway === undefined ? new Map() : new Map([[id, doorwayIn(host, along, next, doorway)]]);
    });
  return [
    { id: "width", label: "Width", unit: "m", value: rounded(size.widthM), min: 0.1, step: 0.05, set: (now, to) => shape("set the width of a doorway", alongM, { ...size, widthM: to })(now) },
    { id: "height", label: "Height", unit: "m", value: rounded(size.heightM), min: 0.1, step: 0.05, set: (now, to) => shape("set the height of a doorway", alongM, { ...size, heightM: to })(now) },
    { id: "from-end", label: "From wall’s end", unit: "m", value: rounded(alongM - size.widthM / 2), step: 0.05, set: (now, to) => shape("move a doorway", to + size.widthM / 2, size)(now) },
  ];
}

function rounded(value: number): number {
  return Math.round(value * 1e4) / 1e4;
}

/** The next wall by its length and direction; without a direction, towards the pointer. */
export function wallTyped(editing: EditingState, lengthM: number, angleDeg: number | null, hand: Hand): Partial<EditingState> {
  const { sketch } = editing;
  if (sketch.kind !== "walls" || !(lengthM > 0)) return {};
  const [from, to] = [sketch.points.at(-1), sketch.snap?.at];
  if (from === undefined) return {};
  const towards = to === undefined ? 0 : Math.atan2(to[1] - from[1], to[0] - from[0]);
  const angle = angleDeg === null ? towards : angleDeg * RAD;
  return pointAdded(editing, [from[0] + lengthM * Math.cos(angle), from[1] + lengthM * Math.sin(angle)], hand);
}

/** With another name for what is chosen. */
export function named(editing: EditingState, name: string): Partial<EditingState> {
  const { copy, chosen } = editing;
  const [id] = chosen;
  const object = id === undefined ? undefined : copy?.now.get(id);
  if (id === undefined || object === undefined || (object.name ?? "") === name) return {};
  return edited(editing, "name an object", new Map([[id, { ...object, name }]]));
}

/** How many doorways go with what is chosen. */
export function companionsOf({ copy, chosen }: EditingState): number {
  return copy === null ? 0 : withDoorways(copy.now, chosen).size - chosen.size;
}
