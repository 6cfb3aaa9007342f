// Paints what the operator has chosen: a halo around it, and for a segment the side it is seen from.

import { middleOf, piecesOf, pointOnLine } from "../geometry";
import type { Theme } from "../palette";
import type { State } from "../state";
import type { Segment } from "../wire";
import { xScreenFromLevel, yScreenFromLevel, type Frame } from "./frame";
import { traceChain } from "./paint_chains";
import { tracePolygon } from "./paint_clusters";

const HALO_PX = 9;
const TICK_PX = 16;

export function paintSelection(frame: Frame, state: State, theme: Theme): void {
  const { selection, content } = state;
  if (selection === null) return;
  const { pen } = frame;
  pen.strokeStyle = theme.chosen;
  pen.lineWidth = HALO_PX;
  pen.lineCap = "round";
  pen.lineJoin = "round";
  switch (selection.kind) {
    case "segment": {
      const segment = content.segments.get(selection.id);
      if (segment !== undefined) paintSegmentHalo(frame, segment);
      break;
    }
    case "cluster": {
      const cluster = content.clusters.get(selection.id);
      if (cluster === undefined) break;
      tracePolygon(frame, cluster);
      pen.stroke();
      break;
    }
    case "chain": {
      const chain = content.chains.get(selection.id);
      if (chain === undefined) break;
      traceChain(frame, chain);
      pen.stroke();
      break;
    }
    case "landmark": {
      const landmark = state.model.landmarks.get(selection.id);
      if (landmark === undefined) break;
      const [x, y] = landmark.at_m;
      pen.lineWidth = 4;
      pen.beginPath();
      pen.arc(xScreenFromLevel(frame, x), yScreenFromLevel(frame, y), 9, 0, 2 * Math.PI);
      pen.stroke();
      break;
    }
    case "robot": {
      const pose = state.robots.find((robot) => robot.robot === selection.id)?.last_pose;
      if (pose == null) break;
      pen.lineWidth = 4;
      pen.beginPath();
      pen.arc(xScreenFromLevel(frame, pose.x_m), yScreenFromLevel(frame, pose.y_m), 20, 0, 2 * Math.PI);
      pen.stroke();
      break;
    }
  }
}

/** Adds the solid pieces of a segment to the pen's path. */
export function tracePieces(frame: Frame, segment: Segment): void {
  const { pen } = frame;
  for (const [x0, y0, x1, y1] of piecesOf(segment)) {
    pen.moveTo(xScreenFromLevel(frame, x0), yScreenFromLevel(frame, y0));
    pen.lineTo(xScreenFromLevel(frame, x1), yScreenFromLevel(frame, y1));
  }
}

function paintSegmentHalo(frame: Frame, segment: Segment): void {
  const { pen } = frame;
  pen.beginPath();
  tracePieces(frame, segment);
  // The normal points away from the level's origin.
  const [x, y] = pointOnLine(segment, middleOf(segment));
  const towards = segment.facing === "away" ? 1 : -1;
  const xPx = xScreenFromLevel(frame, x);
  const yPx = yScreenFromLevel(frame, y);
  pen.moveTo(xPx, yPx);
  pen.lineTo(
    xPx + towards * TICK_PX * Math.cos(segment.alpha_rad),
    yPx - towards * TICK_PX * Math.sin(segment.alpha_rad),
  );
  pen.stroke();
}
