// Paints landmarks: a disc where each is, a ray to where it opens. Corners that jut out are filled, those of
// rooms hollow, ends of walls small, doorways have a ray to both sides. What only robots know has a dashed ring around it.

import type { Theme } from "../palette";
import type { Landmark, LandmarkKind } from "../wire";
import { boxShown, xScreenFromLevel, yScreenFromLevel, type Frame } from "./frame";

const RADIUS_PX: Readonly<Record<LandmarkKind, number>> = { convex_corner: 4, concave_corner: 4, wall_end: 2.5, doorway: 3 };
const RAY_PX = 10;
/** Of the ring around a landmark that robots taught. */
const RING_PX = 7;
/** Metres per pixel from which on rays would only blur. */
const RAYS_UP_TO = 0.12;

/** Paints the landmarks that are on the screen and answers how many they are. */
export function paintLandmarks(frame: Frame, landmarks: Iterable<Landmark>, theme: Theme): number {
  const { pen } = frame;
  const [left, bottom, right, top] = boxShown(frame, RAY_PX);
  let painted = 0;
  pen.strokeStyle = theme.landmark;
  pen.lineWidth = 1.5;
  pen.lineCap = "round";
  for (const { at_m: at, heading_rad: headingRad, kind, source } of landmarks) {
    const [x, y] = at;
    if (x < left || x > right || y < bottom || y > top) continue;
    painted++;
    const [xPx, yPx] = [xScreenFromLevel(frame, x), yScreenFromLevel(frame, y)];
    // The screen's y points down.
    const [xRay, yRay] = [RAY_PX * Math.cos(headingRad), -RAY_PX * Math.sin(headingRad)];
    pen.fillStyle = kind === "concave_corner" || kind === "doorway" ? theme.unknown : theme.landmark;
    if (frame.resolution <= RAYS_UP_TO) {
      pen.beginPath();
      pen.moveTo(kind === "doorway" ? xPx - xRay : xPx, kind === "doorway" ? yPx - yRay : yPx);
      pen.lineTo(xPx + xRay, yPx + yRay);
      pen.stroke();
    }
    pen.beginPath();
    pen.arc(xPx, yPx, RADIUS_PX[kind], 0, 2 * Math.PI);
    pen.fill();
    pen.stroke();
    if (source === "learned") {
      pen.setLineDash([2, 2]);
      pen.beginPath();
      pen.arc(xPx, yPx, RING_PX, 0, 2 * Math.PI);
      pen.stroke();
      pen.setLineDash([]);
    }
  }
  return painted;
}
