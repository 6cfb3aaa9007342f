// Paints what robots found against the model: new things and where objects stand now hatched, what is missing crossed out,
// openings as thick gaps, motions as arrows. Shapes tell the kinds apart, not colours.

import { middleOf } from "../changes";
import type { Theme } from "../palette";
import type { ModelChange } from "../wire";
import { boxShown, xScreenFromLevel, yScreenFromLevel, type Frame } from "./frame";

const LINE_PX = 2;
const MISSING_DASH_PX = [5, 4];
const OPEN_PX = 6;
const HEAD_PX = 8;
const FILL_ALPHA = 0.22;
/** What was answered is painted as much fainter. */
const ANSWERED_ALPHA = 0.45;

/** Paints the changes that are on the screen and answers how many they are. */
export function paintChanges(frame: Frame, changes: Iterable<ModelChange>, theme: Theme): number {
  const { pen } = frame;
  const alpha = pen.globalAlpha;
  const [left, bottom, right, top] = boxShown(frame, HEAD_PX);
  let painted = 0;
  pen.strokeStyle = theme.clash;
  pen.fillStyle = theme.clash;
  pen.lineJoin = "round";
  pen.lineCap = "butt";
  for (const change of changes) {
    const { hull_m: hull } = change;
    const isSeen = hull.some(([x, y]) => x >= left && x <= right && y >= bottom && y <= top);
    if (!isSeen) continue;
    painted++;
    const strength = change.state === "open" ? alpha : alpha * ANSWERED_ALPHA;
    pen.globalAlpha = strength;
    pen.lineWidth = LINE_PX;
    if (change.kind === "opened") {
      pen.lineWidth = OPEN_PX;
      pen.beginPath();
      for (const { from_m: from, to_m: to } of change.stretches ?? []) line(frame, from, to);
      pen.stroke();
      continue;
    }
    pen.setLineDash(change.kind === "missing" ? MISSING_DASH_PX : []);
    pen.beginPath();
    hull.forEach((at, index) => {
      const [xPx, yPx] = [xScreenFromLevel(frame, at[0]), yScreenFromLevel(frame, at[1])];
      if (index === 0) pen.moveTo(xPx, yPx);
      else pen.lineTo(xPx, yPx);
    });
    pen.closePath();
    if (change.kind !== "missing") {
      pen.globalAlpha = strength * FILL_ALPHA;
      pen.fill();
      pen.globalAlpha = strength;
    }
    pen.stroke();
    pen.setLineDash([]);
    if (change.kind === "missing") cross(frame, hull);
    if (change.kind === "moved") arrow(frame, change);
  }
  pen.globalAlpha = alpha;
  pen.lineCap = "round";
  return painted;
}

type Point = readonly [number, number];

function line(frame: Frame, from: Point, to: Point): void {
  frame.pen.moveTo(xScreenFromLevel(frame, from[0]), yScreenFromLevel(frame, from[1]));
  frame.pen.lineTo(xScreenFromLevel(frame, to[0]), yScreenFromLevel(frame, to[1]));
}

/** From each of the first corners to one on the other side. */
function cross(frame: Frame, hull: readonly Point[]): void {
  const half = Math.floor(hull.length / 2);
  frame.pen.beginPath();
  for (let index = 0; index < Math.min(half, 2); index++) {
    const [from, to] = [hull[index], hull[index + half]];
    if (from !== undefined && to !== undefined) line(frame, from, to);
  }
  frame.pen.stroke();
}

/** From where the model has the middle of the hull to where it is. */
function arrow(frame: Frame, change: ModelChange): void {
  const to = middleOf(change);
  const { motion } = change;
  if (to === null || motion == null) return;
  // The motion undone: shifted back, then turned back.
  const [x, y] = [to[0] - motion.x_m, to[1] - motion.y_m];
  const [sin, cos] = [Math.sin(motion.heading_rad), Math.cos(motion.heading_rad)];
  const from: Point = [cos * x + sin * y, cos * y - sin * x];
  const { pen } = frame;
  pen.beginPath();
  line(frame, from, to);
  const [xPx, yPx] = [xScreenFromLevel(frame, to[0]), yScreenFromLevel(frame, to[1])];
  const angle = Math.atan2(yPx - yScreenFromLevel(frame, from[1]), xPx - xScreenFromLevel(frame, from[0]));
  for (const side of [-0.5, 0.5]) {
    pen.moveTo(xPx, yPx);
    pen.lineTo(xPx - HEAD_PX * Math.cos(angle + side), yPx - HEAD_PX * Math.sin(angle + side));
  }
  pen.stroke();
}
