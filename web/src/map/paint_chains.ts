// Paints chains: what walls that meet add up to, as a band beneath the walls themselves. Polygons are
// lightly filled; the vertices, where there is room, bear their 95 % ellipses.

import { ellipse95 } from "../geometry";
import type { Theme } from "../palette";
import type { Chain } from "../wire";
import { boxShown, xScreenFromLevel, yScreenFromLevel, type Frame } from "./frame";

const BAND_PX = 7;
const VERTEX_PX = 2;
/** Metres per pixel up to which vertices are shown. */
const VERTICES_FROM = 0.04;
/** How much of an obstacle or of a room shows in its colour. */
const FILL_ALPHA: Readonly<Record<Chain["kind"], number>> = { polyline: 0, obstacle: 0.3, room: 0.1 };

/** Paints the chains that are on the screen and answers how many they are. */
export function paintChains(frame: Frame, chains: Iterable<Chain>, theme: Theme): number {
  const { pen } = frame;
  const [left, bottom, right, top] = boxShown(frame, BAND_PX);
  const alpha = pen.globalAlpha;
  let painted = 0;
  pen.lineJoin = "round";
  pen.lineCap = "round";
  pen.strokeStyle = theme.chain;
  pen.fillStyle = theme.chain;
  for (const chain of chains) {
    const xs = chain.vertices_m.map(([x]) => x);
    const ys = chain.vertices_m.map(([, y]) => y);
    if (Math.max(...xs) < left || Math.min(...xs) > right) continue;
    if (Math.max(...ys) < bottom || Math.min(...ys) > top) continue;
    painted++;
    traceChain(frame, chain);
    if (chain.closed) {
      pen.globalAlpha = alpha * FILL_ALPHA[chain.kind];
      pen.fill();
    }
    pen.globalAlpha = alpha * 0.35;
    pen.lineWidth = BAND_PX;
    pen.stroke();
    if (frame.resolution > VERTICES_FROM) continue;
    pen.globalAlpha = alpha;
    pen.lineWidth = 1;
    for (const [index, [x, y]] of chain.vertices_m.entries()) {
      const [xPx, yPx] = [xScreenFromLevel(frame, x), yScreenFromLevel(frame, y)];
      pen.beginPath();
      pen.arc(xPx, yPx, VERTEX_PX, 0, 2 * Math.PI);
      pen.fill();
      const covariance = chain.covariances[index];
      if (covariance === undefined) continue;
      const [[xx, xy], [, yy]] = covariance;
      const { majorM, minorM, angleRad } = ellipse95(xx, xy, yy);
      pen.beginPath();
      pen.ellipse(xPx, yPx, majorM / frame.resolution, minorM / frame.resolution, -angleRad, 0, 2 * Math.PI);
      pen.stroke();
    }
  }
  pen.globalAlpha = alpha;
  return painted;
}

/** Lays a chain as the current path. */
export function traceChain(frame: Frame, chain: Chain): void {
  frame.pen.beginPath();
  for (const [x, y] of chain.vertices_m) {
    frame.pen.lineTo(xScreenFromLevel(frame, x), yScreenFromLevel(frame, y));
  }
  if (chain.closed) frame.pen.closePath();
}
