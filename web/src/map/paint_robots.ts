// Paints robots: an arrow along the heading, the ellipse that holds the position with 95 %, and the
// name with what the robot can observe. A full arrow can scan; a hollow one has only sonar.

import { poseEllipse95, Z_95 } from "../geometry";
import { strokeOf, type Theme } from "../palette";
import type { PlacedRobot } from "../state";
import { xScreenFromLevel, yScreenFromLevel, type Frame } from "./frame";
import { clearOf, labelOf, paintLabel, type Label } from "./robot_labels";

/** A robot as it is drawn. */
export interface RobotMark {
  robot: PlacedRobot;
  slot: number;
  silent: boolean;
}

/** Half the length of an arrow. */
const ARROW_PX = 13;
/** An uncertain heading is drawn as a fan this long. */
const FAN_PX = 30;

/** Paints robots; those heard lie above the silent ones, and no label hides an arrow. */
export function paintRobots(frame: Frame, marks: readonly RobotMark[], theme: Theme): void {
  const ordered = [...marks].sort((a, b) => Number(b.silent) - Number(a.silent));
  for (const mark of ordered) paintUncertainty(frame, mark, theme);
  // Those heard choose their places first.
  const labels: Label[] = [];
  for (const mark of [...ordered].reverse()) {
    const wanted = labelOf(frame, mark, { colour: colourOf(mark, theme), belowPx: ARROW_PX + 7 });
    labels.push(clearOf(labels, wanted));
  }
  for (const label of labels) paintLabel(frame, label, theme);
  for (const mark of ordered) paintArrow(frame, mark, theme);
}

function colourOf(mark: RobotMark, theme: Theme): string {
  return mark.silent ? theme.silent : strokeOf(theme, mark.slot).colour;
}

function paintUncertainty(frame: Frame, mark: RobotMark, theme: Theme): void {
  const pose = mark.robot.last_pose;
  const { pen } = frame;
  const x = xScreenFromLevel(frame, pose.x_m);
  const y = yScreenFromLevel(frame, pose.y_m);
  const ellipse = poseEllipse95(pose.covariance);
  pen.fillStyle = colourOf(mark, theme);
  pen.strokeStyle = colourOf(mark, theme);
  pen.lineWidth = 1.25;

  pen.beginPath();
  // The screen's y points down: angles turn over.
  pen.ellipse(x, y, ellipse.majorM / frame.resolution, ellipse.minorM / frame.resolution, -ellipse.angleRad, 0, 2 * Math.PI);
  fillFaintly(pen, 0.16);
  pen.stroke();

  const spread = Math.min(Math.PI, Z_95 * Math.sqrt(Math.max(0, pose.covariance[2][2])));
  pen.beginPath();
  pen.moveTo(x, y);
  pen.arc(x, y, FAN_PX, -pose.heading_rad - spread, -pose.heading_rad + spread);
  pen.closePath();
  fillFaintly(pen, 0.2);
}

function fillFaintly(pen: Frame["pen"], strength: number): void {
  const alpha = pen.globalAlpha;
  pen.globalAlpha = alpha * strength;
  pen.fill();
  pen.globalAlpha = alpha;
}

function paintArrow(frame: Frame, mark: RobotMark, theme: Theme): void {
  const pose = mark.robot.last_pose;
  const { pen } = frame;
  const hollow = !mark.robot.competence.includes("scanner");
  pen.save();
  pen.translate(xScreenFromLevel(frame, pose.x_m), yScreenFromLevel(frame, pose.y_m));
  pen.rotate(-pose.heading_rad);
  pen.lineJoin = "round";
  traceArrow(pen, ARROW_PX);
  pen.strokeStyle = theme.label;
  pen.lineWidth = 6;
  pen.stroke();
  pen.fillStyle = hollow ? theme.label : colourOf(mark, theme);
  pen.strokeStyle = colourOf(mark, theme);
  pen.lineWidth = 2.5;
  pen.fill();
  pen.stroke();
  pen.restore();
}

/** Begins a path that is an arrow along x, half of it so long. */
export function traceArrow(pen: Frame["pen"], halfPx: number): void {
  pen.beginPath();
  pen.moveTo(halfPx, 0);
  pen.lineTo(-halfPx * 0.8, halfPx * 0.75);
  pen.lineTo(-halfPx * 0.4, 0);
  pen.lineTo(-halfPx * 0.8, -halfPx * 0.75);
  pen.closePath();
}
