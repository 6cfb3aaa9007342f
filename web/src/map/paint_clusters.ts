// Paints clusters: the hulls of points that no line explains.

import { strokeOf, strokeOfSeveral, type Theme } from "../palette";
import type { Cluster } from "../wire";
import { slotOf } from "./batches";
import { boxShown, xScreenFromLevel, yScreenFromLevel, type Frame } from "./frame";

/** Paints the hulls that are on the screen. */
export function paintClusters(
  frame: Frame,
  clusters: Iterable<Cluster>,
  options: { slots: ReadonlyMap<string, number>; theme: Theme },
): void {
  const { pen } = frame;
  const [left, bottom, right, top] = boxShown(frame, 8);
  pen.lineWidth = 1;
  pen.lineJoin = "round";
  for (const cluster of clusters) {
    const [x, y] = cluster.centroid_m;
    if (x < left || x > right || y < bottom || y > top) continue;
    const slot = slotOf(cluster.robots, options.slots);
    const { colour } = slot === null ? strokeOfSeveral(options.theme) : strokeOf(options.theme, slot);
    tracePolygon(frame, cluster);
    pen.fillStyle = colour;
    pen.strokeStyle = colour;
    const alpha = pen.globalAlpha;
    pen.globalAlpha = alpha * 0.22;
    pen.fill();
    pen.globalAlpha = alpha * 0.8;
    pen.stroke();
    pen.globalAlpha = alpha;
  }
}

/** Lays a cluster's hull as the current path. */
export function tracePolygon(frame: Frame, cluster: Cluster): void {
  frame.pen.beginPath();
  for (const [x, y] of cluster.hull_m) {
    frame.pen.lineTo(xScreenFromLevel(frame, x), yScreenFromLevel(frame, y));
  }
  frame.pen.closePath();
}
