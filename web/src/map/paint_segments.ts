// Paints segments, batch by batch.

import { strokeOf, strokeOfSeveral, type Theme } from "../palette";
import type { Batch } from "./batches";
import { boxShown, xScreenFromLevel, yScreenFromLevel, type Frame } from "./frame";

/** Pieces in one stroke: canvas strokes slow down more than linearly with the length of their path. */
const PIECES_PER_STROKE = 250;

/** Width of lines: as walls are when seen near, never finer than can be seen. */
function lineWidthPx(resolution: number): number {
  return Math.min(4, Math.max(1.75, 0.06 / resolution));
}

/** Paints the batches and answers how many pieces of them are on the screen. */
export function paintSegments(frame: Frame, batches: readonly Batch[], theme: Theme): number {
  const { pen } = frame;
  const [left, bottom, right, top] = boxShown(frame, 8);
  const xOffsetPx = xScreenFromLevel(frame, 0);
  const yOffsetPx = yScreenFromLevel(frame, 0);
  const pxPerM = 1 / frame.resolution;
  let painted = 0;

  pen.lineCap = "butt";
  pen.lineWidth = lineWidthPx(frame.resolution);
  for (const { slot, ends } of batches) {
    const stroke = slot === null ? strokeOfSeveral(theme) : strokeOf(theme, slot);
    pen.strokeStyle = stroke.colour;
    pen.setLineDash([...stroke.dash]);
    let inPath = 0;
    pen.beginPath();
    for (let i = 0; i + 3 < ends.length; i += 4) {
      const x0 = ends[i] ?? 0;
      const y0 = ends[i + 1] ?? 0;
      const x1 = ends[i + 2] ?? 0;
      const y1 = ends[i + 3] ?? 0;
      if ((x0 < left && x1 < left) || (x0 > right && x1 > right)) continue;
      if ((y0 < bottom && y1 < bottom) || (y0 > top && y1 > top)) continue;
      pen.moveTo(xOffsetPx + x0 * pxPerM, yOffsetPx - y0 * pxPerM);
      pen.lineTo(xOffsetPx + x1 * pxPerM, yOffsetPx - y1 * pxPerM);
      painted++;
      if (++inPath === PIECES_PER_STROKE) {
        pen.stroke();
        pen.beginPath();
        inPath = 0;
      }
    }
    pen.stroke();
  }
  pen.setLineDash([]);
  return painted;
}
