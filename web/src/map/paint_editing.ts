// Paints the draft as it is being edited: objects by kind, what is not sent yet, what is chosen, and what the tool at
// hand is in the middle of, with the mark of what it has snapped to.

import { shownObjects, type EditingState, type Sketch } from "../editing";
import { GHOST } from "../editing/pointing";
import { boxOf, groundsOf, nameOf, type Library, type Objects } from "../editing/objects";
import { SNAP_WORDS, type Snap } from "../editing/snapping";
import { angleOf, endsOf, lengthOf, placeOn, wallOf, type Wall } from "../editing/walls";
import type { Box, Point } from "../geometry";
import type { Theme } from "../palette";
import type { GdbObject, ObjectKind } from "../wire";
import { degrees, lengthInWords } from "../words";
import { boxShown, xScreenFromLevel, yScreenFromLevel, type Frame } from "./frame";

/** How much of an object shows in its colour. */
const FILL_ALPHA: Readonly<Record<ObjectKind, number>> = { corridor: 0.05, wall: 0.42, machine: 0.22, furniture: 0.16, other: 0.16, doorway: 0.85 };
const DASH_PX: Readonly<Partial<Record<ObjectKind, readonly number[]>>> = { corridor: [2, 4], doorway: [4, 3] };
/** From below to above. */
const ORDER: readonly ObjectKind[] = ["corridor", "wall", "machine", "furniture", "other", "doorway"];
const CLASH_DASH_PX = [7, 4];
const HALO_PX = 10;
const HANDLE_PX = 5;
const MARK_PX = 6;
/** Objects at least this long on the screen are named. */
const NAMED_FROM_PX = 60;

/** What tells objects apart on the map. */
export interface Marked {
  unsent: ReadonlyMap<string, unknown>;
  clashing: ReadonlySet<string>;
}

export function paintEditing(frame: Frame, editing: EditingState, marked: Marked, theme: Theme): void {
  const objects = shownObjects(editing);
  const shown = onScreen(objects, editing.library, boxShown(frame, HALO_PX));
  paintHalo(frame, editing, objects, theme);
  for (const kind of ORDER) {
    const ofKind = shown.filter(([, object]) => object.kind === kind);
    for (const isDrawn of [false, true]) {
      const some = ofKind.filter(([id]) => (marked.unsent.has(id) || id === GHOST) === isDrawn);
      if (some.length > 0) paintKind(frame, some, { kind, colour: isDrawn ? theme.drawn : theme.model, library: editing.library, theme });
    }
  }
  paintClashes(frame, shown.filter(([id]) => marked.clashing.has(id)), editing.library, theme);
  for (const [, object] of shown) paintName(frame, object, editing.library, theme);
  paintHandles(frame, editing, objects, theme);
  paintSketch(frame, editing, theme);
}

function onScreen(objects: Objects, library: Library, [left, bottom, right, top]: Box): [string, GdbObject][] {
  return [...objects].filter(([, object]) => {
    const box = boxOf(object, library);
    return box !== null && box[0] <= right && box[2] >= left && box[1] <= top && box[3] >= bottom;
  });
}

function trace(frame: Frame, ring: readonly Point[]): void {
  ring.forEach(([x, y], index) => {
    if (index === 0) frame.pen.moveTo(xScreenFromLevel(frame, x), yScreenFromLevel(frame, y));
    else frame.pen.lineTo(xScreenFromLevel(frame, x), yScreenFromLevel(frame, y));
  });
}

function traceObject(frame: Frame, object: GdbObject, library: Library): void {
  for (const { rings } of groundsOf(object, library)) {
    for (const ring of rings) {
      trace(frame, ring);
      frame.pen.closePath();
    }
  }
}

interface KindStyle {
  kind: ObjectKind;
  colour: string;
  library: Library;
  theme: Theme;
}

function paintKind(frame: Frame, objects: readonly [string, GdbObject][], { kind, colour, library, theme }: KindStyle): void {
  const { pen } = frame;
  const alpha = pen.globalAlpha;
  pen.lineWidth = colour === theme.drawn ? 1.75 : 1.25;
  pen.strokeStyle = colour;
  pen.fillStyle = kind === "doorway" ? theme.unknown : colour;
  pen.lineJoin = "miter";
  pen.setLineDash([...(DASH_PX[kind] ?? [])]);
  const grounds = objects.flatMap(([, object]) => groundsOf(object, library));
  pen.globalAlpha = alpha * FILL_ALPHA[kind];
  // All in one path: outer rings run the same way, so that what overlaps is filled once.
  pen.beginPath();
  for (const { rings: [outer, ...holes] } of grounds) {
    if (outer === undefined || holes.length > 0) continue;
    trace(frame, outer);
    pen.closePath();
  }
  pen.fill("nonzero");
  for (const { rings } of grounds) {
    if (rings.length < 2) continue;
    pen.beginPath();
    for (const ring of rings) {
      trace(frame, ring);
      pen.closePath();
    }
    pen.fill("evenodd");
  }
  pen.globalAlpha = alpha;
  pen.beginPath();
  for (const [, object] of objects) traceObject(frame, object, library);
  pen.stroke();
  pen.setLineDash([]);
}

/** Dashed in their own colour, and with a sign, so that no eye depends on the colour. */
function paintClashes(frame: Frame, objects: readonly [string, GdbObject][], library: Library, theme: Theme): void {
  const { pen } = frame;
  pen.strokeStyle = theme.clash;
  pen.lineWidth = 3;
  pen.setLineDash(CLASH_DASH_PX);
  pen.beginPath();
  for (const [, object] of objects) traceObject(frame, object, library);
  pen.stroke();
  pen.setLineDash([]);
  for (const [, object] of objects) {
    const box = boxOf(object, library);
    if (box !== null) label(frame, [(box[0] + box[2]) / 2, (box[1] + box[3]) / 2], "!", theme);
  }
}

function paintHalo(frame: Frame, { chosen, library }: EditingState, objects: Objects, theme: Theme): void {
  const { pen } = frame;
  pen.strokeStyle = theme.chosen;
  pen.lineWidth = HALO_PX;
  pen.lineJoin = "round";
  pen.beginPath();
  for (const id of chosen) {
    const object = objects.get(id);
    if (object !== undefined) traceObject(frame, object, library);
  }
  pen.stroke();
}

/** The ends of the only wall that is chosen, by which it is pulled, and its measures. */
function paintHandles(frame: Frame, { chosen, tool }: EditingState, objects: Objects, theme: Theme): void {
  const [only] = chosen;
  const wall = only === undefined || chosen.size !== 1 || tool !== "select" ? null : wallOf(objects.get(only) ?? { kind: "other" });
  if (wall === null) return;
  for (const end of endsOf(wall)) square(frame, end, HANDLE_PX, theme.drawn, theme.label);
  label(frame, placeOn(wall, lengthOf(wall) / 2), measures(wall), theme, 14);
}

function paintName(frame: Frame, object: GdbObject, library: Library, theme: Theme): void {
  if (object.kind === "wall" || object.kind === "doorway") return;
  const box = boxOf(object, library);
  if (box === null || (box[2] - box[0]) / frame.resolution < NAMED_FROM_PX) return;
  if ((object.name ?? "") === "" && object.prototype == null) return;
  const text = (object.name ?? "") === "" ? nameOf(object) : (object.name ?? "");
  label(frame, [(box[0] + box[2]) / 2, (box[1] + box[3]) / 2], text, theme);
}

function measures(wall: Wall): string {
  return `${lengthInWords(lengthOf(wall))} · ${degrees(angleOf(wall))}`;
}

function paintSketch(frame: Frame, { sketch, making }: EditingState, theme: Theme): void {
  const { pen } = frame;
  switch (sketch.kind) {
    case "none":
      return;
    case "box": {
      const [x0, y0] = [xScreenFromLevel(frame, sketch.from[0]), yScreenFromLevel(frame, sketch.from[1])];
      const [x1, y1] = [xScreenFromLevel(frame, sketch.to[0]), yScreenFromLevel(frame, sketch.to[1])];
      const alpha = pen.globalAlpha;
      pen.beginPath();
      for (const [x, y] of [[x0, y0], [x1, y0], [x1, y1], [x0, y1]] as const) pen.lineTo(x, y);
      pen.closePath();
      pen.fillStyle = theme.drawn;
      pen.globalAlpha = alpha * 0.12;
      pen.fill();
      pen.globalAlpha = alpha;
      pen.strokeStyle = theme.drawn;
      pen.lineWidth = 1.25;
      pen.setLineDash([5, 4]);
      pen.stroke();
      pen.setLineDash([]);
      return;
    }
    case "walls":
      paintWalls(frame, sketch, making.thicknessM, theme);
      break;
    case "hover":
    case "drag":
      break;
  }
  if (sketch.snap !== null) paintSnap(frame, sketch.snap, theme);
}

function paintWalls(frame: Frame, { points, snap }: Extract<Sketch, { kind: "walls" }>, thicknessM: number, theme: Theme): void {
  const { pen } = frame;
  const alpha = pen.globalAlpha;
  const all = snap === null ? points : [...points, snap.at];
  pen.strokeStyle = theme.drawn;
  pen.lineJoin = "miter";
  pen.lineCap = "butt";
  pen.beginPath();
  trace(frame, all);
  pen.lineWidth = Math.max(2, thicknessM / frame.resolution);
  pen.globalAlpha = alpha * 0.4;
  pen.stroke();
  pen.globalAlpha = alpha;
  pen.lineWidth = 1.25;
  pen.stroke();
  for (const point of points) square(frame, point, 3, theme.drawn, theme.label);
  const [from, to] = [all.at(-2), all.at(-1)];
  if (from === undefined || to === undefined || snap === null) return;
  const wall: Wall = { a: from, b: to, thicknessM, lowerM: 0, upperM: 0 };
  if (lengthOf(wall) > 0) label(frame, placeOn(wall, lengthOf(wall) / 2), measures(wall), theme, 16);
}

/** Each kind of place that a point has snapped to has a mark of its own form. */
function paintSnap(frame: Frame, { at, kind, guide }: Snap, theme: Theme): void {
  if (kind === "free") return;
  const { pen } = frame;
  const [x, y] = [xScreenFromLevel(frame, at[0]), yScreenFromLevel(frame, at[1])];
  pen.strokeStyle = theme.clash;
  pen.lineCap = "butt";
  if (guide !== null) {
    pen.lineWidth = 1;
    pen.setLineDash([2, 3]);
    pen.beginPath();
    trace(frame, [[guide[0], guide[1]], [guide[2], guide[3]]]);
    pen.stroke();
    pen.setLineDash([]);
  }
  pen.lineWidth = 2;
  pen.beginPath();
  switch (kind) {
    case "end":
      for (const [dx, dy] of [[-1, -1], [1, -1], [1, 1], [-1, 1]] as const) pen.lineTo(x + dx * MARK_PX, y + dy * MARK_PX);
      pen.closePath();
      break;
    case "perpendicular":
      pen.moveTo(x - MARK_PX, y + MARK_PX);
      pen.lineTo(x + MARK_PX, y + MARK_PX);
      pen.moveTo(x, y + MARK_PX);
      pen.lineTo(x, y - MARK_PX);
      break;
    case "crossing":
      for (const side of [-1, 1]) {
        pen.moveTo(x - MARK_PX, y - side * MARK_PX);
        pen.lineTo(x + MARK_PX, y + side * MARK_PX);
      }
      break;
    case "wall":
      pen.arc(x, y, MARK_PX, 0, 2 * Math.PI);
      break;
    case "angle":
      pen.moveTo(x + MARK_PX, y + MARK_PX);
      pen.lineTo(x - MARK_PX, y + MARK_PX);
      pen.lineTo(x + MARK_PX, y - MARK_PX);
      break;
    case "grid":
      pen.moveTo(x - MARK_PX, y);
      pen.lineTo(x + MARK_PX, y);
      pen.moveTo(x, y - MARK_PX);
      pen.lineTo(x, y + MARK_PX);
      break;
  }
  pen.stroke();
  label(frame, [at[0] + 14 * frame.resolution, at[1] - 16 * frame.resolution], SNAP_WORDS[kind], theme, 0, "left");
}

function square(frame: Frame, at: Point, halfPx: number, line: string, fill: string): void {
  const { pen } = frame;
  const [x, y] = [xScreenFromLevel(frame, at[0]), yScreenFromLevel(frame, at[1])];
  pen.beginPath();
  for (const [dx, dy] of [[-1, -1], [1, -1], [1, 1], [-1, 1]] as const) pen.lineTo(x + dx * halfPx, y + dy * halfPx);
  pen.closePath();
  pen.fillStyle = fill;
  pen.fill();
  pen.strokeStyle = line;
  pen.lineWidth = 1.75;
  pen.stroke();
}

function label(frame: Frame, at: Point, text: string, theme: Theme, abovePx = 0, align: "left" | "center" = "center"): void {
  const { pen } = frame;
  pen.font = "600 12px system-ui, sans-serif";
  pen.textAlign = align;
  pen.textBaseline = "middle";
  const [x, y] = [xScreenFromLevel(frame, at[0]), yScreenFromLevel(frame, at[1]) - abovePx];
  const width = pen.measureText(text).width;
  pen.beginPath();
  pen.roundRect(align === "left" ? x - 4 : x - width / 2 - 4, y - 9, width + 8, 18, 4);
  pen.fillStyle = theme.label;
  pen.fill();
  pen.fillStyle = theme.labelText;
  pen.fillText(text, x, y);
}
