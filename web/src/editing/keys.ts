// Keys while the model is edited, and what they mean. Pure.

import type { EditingState } from "../editing";

export type Command =
  | "undo"
  | "redo"
  | "send"
  | "select-all"
  | "copy"
  | "remove"
  | "escape"
  | "finish"
  | "back"
  | "turn-left"
  | "turn-right"
  | "tool-select"
  | "tool-wall"
  | "tool-doorway"
  | "tool-prototype"
  | "type-length"
  | "nudge-left"
  | "nudge-right"
  | "nudge-up"
  | "nudge-down";

/** A key as the browser tells it. */
export interface Key {
  key: string;
  ctrl: boolean;
  shift: boolean;
  alt: boolean;
}

const PLAIN: Readonly<Record<string, Command>> = {
  v: "tool-select",
  w: "tool-wall",
  d: "tool-doorway",
  p: "tool-prototype",
  r: "turn-left",
  R: "turn-right",
  Escape: "escape",
};

const WITH_CONTROL: Readonly<Record<string, Command>> = { z: "undo", Z: "redo", y: "redo", s: "send", a: "select-all", d: "copy" };

const NUDGES: Readonly<Record<string, Command>> = {
  ArrowLeft: "nudge-left",
  ArrowRight: "nudge-right",
  ArrowUp: "nudge-up",
  ArrowDown: "nudge-down",
};

/** What a key means now; null leaves it to the rest of the page. */
export function commandOf({ key, ctrl, shift, alt }: Key, { on, copy, chosen, sketch }: EditingState): Command | null {
  if (!on || copy === null || alt) return null;
  if (ctrl) return WITH_CONTROL[shift && key === "z" ? "Z" : key] ?? null;
  if (sketch.kind === "walls") {
    if (key === "Enter") return "finish";
    if (key === "Backspace") return "back";
    if (/^[0-9.,]$/.test(key)) return "type-length";
  }
  if (chosen.size > 0) {
    if (key === "Delete" || key === "Backspace") return "remove";
    const nudge = NUDGES[key];
    if (nudge !== undefined) return nudge;
  }
  return PLAIN[key] ?? null;
}
