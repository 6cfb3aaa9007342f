// Plates below robots: the name, and what the robot can observe.

import { competenceInWords } from "../competence";
import type { Theme } from "../palette";
import { xScreenFromLevel, yScreenFromLevel, type Frame } from "./frame";
import type { RobotMark } from "./paint_robots";

/** A plate on the screen. */
export interface Label {
  name: string;
  what: string;
  colour: string;
  xMiddlePx: number;
  topPx: number;
  widthPx: number;
}

const HEIGHT_PX = 33;
const GAP_PX = 2;
const NAME_FONT = "600 12px system-ui, sans-serif";
const WHAT_FONT = "11px system-ui, sans-serif";

/** The plate of a robot, `belowPx` below its position. */
export function labelOf(
  frame: Frame,
  { robot, silent }: RobotMark,
  { colour, belowPx }: { colour: string; belowPx: number },
): Label {
  const { pen } = frame;
  const competence = competenceInWords(robot);
  const what = silent ? `${competence} · offline` : competence;
  pen.font = NAME_FONT;
  const nameWidth = pen.measureText(robot.name).width;
  pen.font = WHAT_FONT;
  const whatWidth = pen.measureText(what).width;
  return {
    name: robot.name,
    what,
    colour,
    xMiddlePx: xScreenFromLevel(frame, robot.last_pose.x_m),
    topPx: yScreenFromLevel(frame, robot.last_pose.y_m) + belowPx,
    widthPx: Math.max(nameWidth, whatWidth) + 12,
  };
}

/** The label, moved down as far as it takes to cover none of the others. */
export function clearOf(others: readonly Label[], label: Label): Label {
  const beside = others.filter(
    (other) => Math.abs(other.xMiddlePx - label.xMiddlePx) < (other.widthPx + label.widthPx) / 2,
  );
  let topPx = label.topPx;
  for (const other of beside.sort((a, b) => a.topPx - b.topPx)) {
    if (Math.abs(other.topPx - topPx) < HEIGHT_PX + GAP_PX) topPx = other.topPx + HEIGHT_PX + GAP_PX;
  }
  return { ...label, topPx };
}

export function paintLabel({ pen }: Frame, label: Label, theme: Theme): void {
  const { xMiddlePx, topPx, widthPx } = label;
  pen.fillStyle = theme.label;
  pen.beginPath();
  pen.roundRect(xMiddlePx - widthPx / 2, topPx, widthPx, HEIGHT_PX, 5);
  pen.fill();
  pen.textAlign = "center";
  pen.textBaseline = "top";
  pen.fillStyle = label.colour;
  pen.font = NAME_FONT;
  pen.fillText(label.name, xMiddlePx, topPx + 4);
  pen.fillStyle = theme.gridText;
  pen.font = WHAT_FONT;
  pen.fillText(label.what, xMiddlePx, topPx + 18);
}
