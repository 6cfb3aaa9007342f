// What the buttons and keys of editing do, on the state as it is. Pure, but for the identities that it is handed.

import { edited, stepped, type EditingState } from "../editing";
import type { Point } from "../geometry";
import { middleOf, nameOf } from "./objects";
import { finished, ghostTurned, pointDropped, whatIsChosen, withTool, type Hand } from "./pointing";
import { copied, removed, rotated, shifted, withDoorways } from "./verbs";
import type { Command } from "./keys";

/** What one press turns by. */
export const TURN_RAD = Math.PI / 12;
/** A nudge without a grid, and how much more one with the shift key moves. */
const NUDGE_M = 0.01;
const NUDGE_MORE = 10;
/** Copies stand this far beside their originals. */
const COPY_BY_M = 0.5;

/** The state after a command; what is not about the state itself (sending, typing a length) is none of this. */
export function commanded(editing: EditingState, command: Command, hand: Hand, isMore = false): Partial<EditingState> {
  switch (command) {
    case "undo":
      return editing.sketch.kind === "walls" ? pointDropped(editing) : stepped(editing, "undo");
    case "redo":
      return stepped(editing, "redo");
    case "select-all":
      return { chosen: new Set(editing.copy?.now.keys()) };
    case "copy": {
      if (editing.copy === null) return {};
      const { puts, copies } = copied(editing.copy.now, editing.chosen, [COPY_BY_M, -COPY_BY_M], hand.uuid);
      return edited(editing, `copy ${whatIsChosen(editing)}`, puts, copies);
    }
    case "remove":
      return editing.copy === null ? {} : edited(editing, `remove ${removalInWords(editing)}`, removed(editing.copy.now, editing.chosen), []);
    case "escape":
      if (editing.sketch.kind === "walls") return finished(editing, hand);
      if (editing.sketch.kind === "drag" || editing.sketch.kind === "box") return { sketch: { kind: "none" } };
      return editing.tool === "select" ? { chosen: new Set() } : withTool(editing, "select", hand);
    case "finish":
      return finished(editing, hand);
    case "back":
      return pointDropped(editing);
    case "turn-left":
      return turnedBy(editing, isMore ? -TURN_RAD : TURN_RAD);
    case "turn-right":
      return turnedBy(editing, -TURN_RAD);
    case "tool-select":
      return withTool(editing, "select", hand);
    case "tool-wall":
      return withTool(editing, "wall", hand);
    case "tool-doorway":
      return withTool(editing, "doorway", hand);
    case "tool-prototype":
      return withTool(editing, "prototype", hand);
    case "nudge-left":
      return nudged(editing, [-1, 0], isMore);
    case "nudge-right":
      return nudged(editing, [1, 0], isMore);
    case "nudge-up":
      return nudged(editing, [0, 1], isMore);
    case "nudge-down":
      return nudged(editing, [0, -1], isMore);
    case "send":
    case "type-length":
      return {};
  }
}

function nudged(editing: EditingState, [x, y]: Point, isMore: boolean): Partial<EditingState> {
  if (editing.copy === null) return {};
  const step = (editing.making.gridM ?? NUDGE_M) * (isMore ? NUDGE_MORE : 1);
  return edited(editing, `move ${whatIsChosen(editing)}`, shifted(editing.copy.now, editing.chosen, [x * step, y * step]));
}

/** Turns what is chosen about its middle; with the prototype tool, what is about to be placed. */
export function turnedBy(editing: EditingState, angleRad: number): Partial<EditingState> {
  const { copy, chosen, library, tool } = editing;
  if (tool === "prototype") return ghostTurned(editing, angleRad);
  if (copy === null || chosen.size === 0) return {};
  const some = [...withDoorways(copy.now, chosen)].flatMap((id) => copy.now.get(id) ?? []);
  const middle = middleOf(some, library);
  return middle === null ? {} : edited(editing, `turn ${whatIsChosen(editing)}`, rotated(copy.now, chosen, middle, angleRad));
}

function removalInWords(editing: EditingState): string {
  const { copy, chosen } = editing;
  const all = copy === null ? new Set<string>() : withDoorways(copy.now, chosen);
  const [only] = chosen;
  if (chosen.size === 1 && all.size > 1 && only !== undefined) return `${nameOf(copy?.now.get(only))} and what is in it`;
  return whatIsChosen(editing);
}
