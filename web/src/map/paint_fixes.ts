// Paints what robots know of their places beyond one pose: every place that a robot may be at while it cannot
// tell, and for the chosen robot the walls and landmarks that its last look was matched with.

import { poseEllipse95 } from "../geometry";
import { strokeOf, type Theme } from "../palette";
import { fixHere, type State } from "../state";
import type { UncertainPose } from "../wire";
import { xScreenFromLevel, yScreenFromLevel, type Frame } from "./frame";
import { traceArrow } from "./paint_robots";
import { tracePieces } from "./paint_selection";

/** Half the length of an arrow at a place that is one of several. */
const ARROW_PX = 11;
const LANDMARK_PX = 8;

/** Paints the places of robots that do not know theirs, and what the chosen one goes by. */
export function paintFixes(frame: Frame, state: State, theme: Theme): void {
  for (const robot of state.robots) {
    const fix = fixHere(state, robot);
    if (fix === null) continue;
    const { colour } = strokeOf(theme, state.slots.get(robot.robot) ?? 0);
    if (fix.kind === "ambiguous") {
      for (const place of fix.places) paintCandidate(frame, place, { colour, theme });
    }
    const { selection } = state;
    if (selection?.kind !== "robot" || selection.id !== robot.robot) continue;
    paintMatched(frame, { state, segments: fix.segments ?? [], landmarks: fix.landmarks_m ?? [] }, theme);
  }
}

function paintCandidate(frame: Frame, place: UncertainPose, { colour, theme }: { colour: string; theme: Theme }): void {
  const { pen } = frame;
  const [x, y] = [xScreenFromLevel(frame, place.x_m), yScreenFromLevel(frame, place.y_m)];
  const ellipse = poseEllipse95(place.covariance);
  pen.save();
  pen.translate(x, y);
  pen.setLineDash([4, 3]);
  pen.strokeStyle = colour;
  pen.lineWidth = 1.5;
  pen.beginPath();
  // The screen's y points down: angles turn over.
  const radii = [ellipse.majorM, ellipse.minorM].map((m) => Math.max(ARROW_PX, m / frame.resolution));
  pen.ellipse(0, 0, radii[0] ?? 0, radii[1] ?? 0, -ellipse.angleRad, 0, 2 * Math.PI);
  pen.stroke();
  pen.rotate(-place.heading_rad);
  pen.setLineDash([]);
  traceArrow(pen, ARROW_PX);
  pen.fillStyle = theme.label;
  pen.fill();
  pen.stroke();
  pen.restore();
}

interface Matched {
  state: State;
  segments: readonly string[];
  landmarks: readonly (readonly [number, number])[];
}

function paintMatched(frame: Frame, { state, segments, landmarks }: Matched, theme: Theme): void {
  const { pen } = frame;
  pen.strokeStyle = theme.chosen;
  pen.lineWidth = 6;
  pen.lineCap = "butt";
  pen.beginPath();
  for (const id of segments) {
    const segment = state.content.segments.get(id);
    if (segment !== undefined) tracePieces(frame, segment);
  }
  pen.stroke();
  pen.lineWidth = 2.5;
  for (const [x, y] of landmarks) {
    pen.beginPath();
    pen.arc(xScreenFromLevel(frame, x), yScreenFromLevel(frame, y), LANDMARK_PX, 0, 2 * Math.PI);
    pen.stroke();
  }
}
