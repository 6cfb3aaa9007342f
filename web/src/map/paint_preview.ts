// Paints where a revert that was tried out would change the map.

import type { Theme } from "../palette";
import type { State } from "../state";
import { xScreenFromLevel, yScreenFromLevel, type Frame } from "./frame";

const DASH_PX = [9, 6];
const MARGIN_PX = 6;

export function paintPreview(frame: Frame, { log }: State, theme: Theme): void {
  const bounds = log.preview?.told.bounds;
  if (bounds == null) return;
  const { pen } = frame;
  const left = xScreenFromLevel(frame, bounds.min_x_m) - MARGIN_PX;
  const top = yScreenFromLevel(frame, bounds.max_y_m) - MARGIN_PX;
  const width = xScreenFromLevel(frame, bounds.max_x_m) + MARGIN_PX - left;
  const height = yScreenFromLevel(frame, bounds.min_y_m) + MARGIN_PX - top;
  pen.strokeStyle = theme.chosen;
  pen.lineWidth = 4;
  pen.setLineDash(DASH_PX);
  pen.beginPath();
  pen.moveTo(left, top);
  pen.lineTo(left + width, top);
  pen.lineTo(left + width, top + height);
  pen.lineTo(left, top + height);
  pen.closePath();
  pen.stroke();
  pen.setLineDash([]);
}
