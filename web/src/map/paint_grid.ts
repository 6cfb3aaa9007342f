// Paints a metric grid with its coordinates along the upper and the left edge.

import type { Theme } from "../palette";
import { gridStep } from "../scale";
import { fixed } from "../words";
import { boxShown, xScreenFromLevel, yScreenFromLevel, type Frame } from "./frame";

const LEAST_PX = 70;
const TEXT_PX = 16;

export function paintGrid(frame: Frame, theme: Theme): void {
  const { pen } = frame;
  const step = gridStep(frame.resolution, LEAST_PX);
  const decimals = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const [left, bottom, right, top] = boxShown(frame, 0);
  pen.lineWidth = 1;
  pen.font = "11px system-ui, sans-serif";
  pen.fillStyle = theme.gridText;

  pen.textAlign = "left";
  pen.textBaseline = "top";
  for (let i = Math.ceil(left / step); i * step <= right; i++) {
    const x = Math.round(xScreenFromLevel(frame, i * step)) + 0.5;
    line(frame, [x, 0, x, frame.heightPx], i === 0 ? theme.gridAxis : theme.grid);
    pen.fillText(fixed(i * step, decimals), x + 4, 5);
  }
  pen.textBaseline = "bottom";
  for (let i = Math.ceil(bottom / step); i * step <= top; i++) {
    const y = Math.round(yScreenFromLevel(frame, i * step)) + 0.5;
    line(frame, [0, y, frame.widthPx, y], i === 0 ? theme.gridAxis : theme.grid);
    // The upper edge belongs to the other axis.
    if (y > 2 * TEXT_PX) pen.fillText(fixed(i * step, decimals), 5, y - 2);
  }
}

function line({ pen }: Frame, [x0, y0, x1, y1]: readonly [number, number, number, number], colour: string): void {
  pen.strokeStyle = colour;
  pen.beginPath();
  pen.moveTo(x0, y0);
  pen.lineTo(x1, y1);
  pen.stroke();
}
