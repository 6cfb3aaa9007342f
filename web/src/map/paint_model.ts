// Paints the plan of the a-priori model: what is solid faintly filled, surfaces as thin lines, doorways as
// dashes from jamb to jamb.

import type { Theme } from "../palette";
import type { GdbPlan, PlanCorner } from "../wire";
import { xScreenFromLevel, yScreenFromLevel, type Frame } from "./frame";

const LINE_PX = 1.25;
const DOOR_DASH_PX = [3, 3];
/** How much of what is solid shows in its colour. */
const FILL_ALPHA = 0.14;

export function paintModel(frame: Frame, plan: GdbPlan, theme: Theme): void {
  const { pen } = frame;
  const alpha = pen.globalAlpha;
  const trace = (corners: readonly PlanCorner[]): void => {
    corners.forEach(({ at_m: [x, y] }, index) => {
      const [xPx, yPx] = [xScreenFromLevel(frame, x), yScreenFromLevel(frame, y)];
      if (index === 0) pen.moveTo(xPx, yPx);
      else pen.lineTo(xPx, yPx);
    });
  };
  pen.strokeStyle = theme.model;
  pen.fillStyle = theme.model;
  pen.lineWidth = LINE_PX;
  pen.lineJoin = "miter";
  pen.lineCap = "butt";

  // All outlines in one path: a room within a wall is a hole in it.
  pen.beginPath();
  for (const outline of plan.outlines) {
    trace(outline);
    pen.closePath();
  }
  pen.globalAlpha = alpha * FILL_ALPHA;
  pen.fill("evenodd");
  pen.globalAlpha = alpha;
  pen.stroke();

  pen.beginPath();
  for (const sheet of plan.sheets) trace(sheet);
  pen.stroke();

  pen.beginPath();
  pen.setLineDash(DOOR_DASH_PX);
  for (const { from_m: from, to_m: to } of plan.openings.flatMap(({ sides }) => sides)) {
    pen.moveTo(xScreenFromLevel(frame, from[0]), yScreenFromLevel(frame, from[1]));
    pen.lineTo(xScreenFromLevel(frame, to[0]), yScreenFromLevel(frame, to[1]));
  }
  pen.stroke();
  pen.setLineDash([]);
}
