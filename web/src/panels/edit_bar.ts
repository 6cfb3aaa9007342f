// The tools for editing the model, on the map: which tool, what it makes, and what can be done to what is chosen.

import { commanded } from "../editing/commands";
import { figuresOf, named, wallTyped, type Figure } from "../editing/figures";
import type { Command } from "../editing/keys";
import { nameOf } from "../editing/objects";
import type { EditActions } from "../editing/acting";
import { whatIsChosen, type Hand } from "../editing/pointing";
import type { Tool } from "../editing";
import { el, keyed, setShown, setText, type Row } from "../dom";
import type { State } from "../state";
import type { Store } from "../store";

const TOOL_BUTTONS: readonly { tool: Tool; text: string; key: string; title: string }[] = [
  { tool: "select", text: "Select", key: "V", title: "Choose, move and reshape (V). Shift adds to what is chosen, and draws a box." },
  { tool: "wall", text: "Wall", key: "W", title: "Draw walls from place to place (W). Enter ends, Alt does not snap; type a length." },
  { tool: "doorway", text: "Doorway", key: "D", title: "Put a doorway into a wall (D)" },
  { tool: "prototype", text: "Prototype", key: "P", title: "Place a prototype of the site (P). R turns it." },
];

const GRIDS_M: readonly (number | null)[] = [null, 0.01, 0.05, 0.1, 0.25, 0.5, 1];

const HINTS: Readonly<Record<Tool, string>> = {
  select: "Click or drag an object; shift adds, and draws a box.",
  wall: "Click where the wall begins.",
  doorway: "Click on a wall.",
  prototype: "Click where it stands; R turns it.",
};

export interface EditBarOptions {
  parent: HTMLElement;
  store: Store;
  actions: EditActions;
  hand: Hand;
}

export function createEditBar({ parent, store, actions, hand }: EditBarOptions): (state: State) => void {
  const editing = (): State["editing"] => store.state().editing;
  const run = (command: Command) => () => {
    actions.change(commanded(editing(), command, hand));
  };
  const button = (text: string, title: string, click: () => void, id?: string): HTMLButtonElement =>
    el("button", { text, attrs: { type: "button", title, ...(id === undefined ? {} : { id }) }, on: { click } });

  const tools = TOOL_BUTTONS.map(({ tool, text, key, title }) => ({
    tool,
    element: el("button", { text, attrs: { type: "button", title, "aria-keyshortcuts": key, id: `tool-${tool}` }, on: { click: run(`tool-${tool}`) } }),
  }));
  const undo = button("Undo", "Take the last edit back (Ctrl+Z)", run("undo"), "edit-undo");
  const redo = button("Redo", "Make it again (Ctrl+Shift+Z)", run("redo"), "edit-redo");
  const turn = button("Turn 15°", "Turn left by 15° (R; Shift+R turns right)", run("turn-left"), "edit-turn");
  const copy = button("Copy", "Copy what is chosen (Ctrl+D)", run("copy"), "edit-copy");
  const remove = button("Remove", "Remove what is chosen (Del)", run("remove"), "edit-remove");
  const finish = button("Finish", "End the walls here (Enter)", run("finish"), "edit-finish");
  const several = button("Several", "Each click adds to what is chosen, and a drag draws a box", () => {
    actions.change({ several: !editing().several });
  });
  const close = button("Done", "Close the editor; what is not sent is kept in this browser", actions.stop, "edit-done");

  const grid = el(
    "select",
    {
      attrs: { id: "edit-grid" },
      on: {
        change: () => {
          actions.change({ making: { ...editing().making, gridM: grid.value === "" ? null : Number(grid.value) } });
        },
      },
    },
    ...GRIDS_M.map((gridM) => el("option", { text: gridM === null ? "none" : gridM < 1 ? `${gridM * 100} cm` : `${gridM} m`, attrs: { value: gridM === null ? "" : String(gridM) } })),
  );
  const prototype = el("select", {
    attrs: { id: "edit-prototype", "aria-label": "Prototype" },
    on: {
      change: () => {
        actions.change({ making: { ...editing().making, prototype: prototype.value } });
      },
    },
  });
  const length = el("input", { attrs: { id: "edit-length", type: "text", inputmode: "decimal", size: "5", autocomplete: "off" } });
  const angle = el("input", { attrs: { id: "edit-angle", type: "text", inputmode: "decimal", size: "5", autocomplete: "off", placeholder: "pointer" } });
  const typed = el(
    "form",
    {
      class: "edit-typed",
      on: {
        submit: (event) => {
          event.preventDefault();
          const [lengthM, degrees] = [numberIn(length.value), numberIn(angle.value)];
          if (lengthM === null) return;
          actions.change(wallTyped(editing(), lengthM, degrees, hand));
          length.value = "";
          angle.value = "";
          // The next key is for the tool again.
          if (document.activeElement instanceof HTMLElement) document.activeElement.blur();
        },
        keydown: (event) => {
          if (event.key === "Escape" && document.activeElement instanceof HTMLElement) document.activeElement.blur();
        },
      },
    },
    el("label", {}, "Length ", length, " m"),
    el("label", {}, "Angle ", angle, " °"),
    el("button", { text: "Add", attrs: { type: "submit", title: "Add a wall of this length (Enter)" } }),
  );
  const name = el("input", {
    attrs: { id: "edit-name", type: "text", maxlength: "60", size: "12", autocomplete: "off" },
    on: {
      change: () => {
        actions.change(named(editing(), name.value.trim()));
      },
    },
  });
  const naming = el("label", {}, "Name ", name);
  const figures = el("span", { class: "edit-figures" });
  const drawFigures = keyed<Figure>(figures, { key: ({ id }) => id, make: () => figureRow(store, actions) });
  const hint = el("span", { class: "hint", attrs: { role: "status" } });

  const bar = el(
    "section",
    { class: "edit-bar card", attrs: { "aria-label": "Edit the model" } },
    el("div", { class: "edit-row", attrs: { role: "toolbar", "aria-label": "Tools" } }, el("span", { class: "edit-tools" }, ...tools.map(({ element }) => element)), undo, redo, turn, copy, remove, several, close),
    el("div", { class: "edit-row" }, hint, prototype, typed, finish, naming, figures, el("label", {}, "Grid ", grid)),
  );
  parent.append(bar);
  let names = "";

  return (state) => {
    const now = state.editing;
    setShown(bar, now.on);
    if (!now.on) return;
    const isChoosing = now.tool === "select";
    for (const { tool, element } of tools) element.setAttribute("aria-pressed", String(tool === now.tool));
    several.setAttribute("aria-pressed", String(now.several));
    setShown(several, isChoosing);
    const isDrawing = now.sketch.kind === "walls";
    undo.disabled = now.copy === null || (now.copy.done.length === 0 && !isDrawing);
    redo.disabled = now.copy === null || now.copy.undone.length === 0;
    undo.title = `Take back: ${now.copy?.done.at(-1)?.label ?? "nothing"} (Ctrl+Z)`;
    redo.title = `Make again: ${now.copy?.undone.at(-1)?.label ?? "nothing"} (Ctrl+Shift+Z)`;
    turn.disabled = now.chosen.size === 0 && now.tool !== "prototype";
    copy.disabled = now.chosen.size === 0;
    remove.disabled = now.chosen.size === 0;
    setShown(typed, isDrawing);
    setShown(finish, isDrawing);
    setShown(prototype, now.tool === "prototype");
    const known = [...now.library.keys()].sort();
    if (JSON.stringify(known) !== names) {
      names = JSON.stringify(known);
      prototype.replaceChildren(...known.map((one) => el("option", { text: one, attrs: { value: one } })));
    }
    prototype.disabled = known.length === 0;
    if (now.making.prototype !== null && prototype.value !== now.making.prototype) prototype.value = now.making.prototype;
    const gridValue = now.making.gridM === null ? "" : String(now.making.gridM);
    if (grid.value !== gridValue) grid.value = gridValue;
    const [only] = now.chosen;
    const object = isChoosing && now.chosen.size === 1 && only !== undefined ? now.copy?.now.get(only) : undefined;
    setShown(naming, object !== undefined);
    if (document.activeElement !== name) name.value = object?.name ?? "";
    drawFigures(isDrawing ? [] : figuresOf(now));
    setShown(hint, !isDrawing);
    setText(hint, hintOf(state, known.length));
  };
}

function hintOf({ editing }: State, prototypes: number): string {
  if (editing.copy === null) return editing.problem ?? "Asking for the draft …";
  if (editing.tool === "prototype" && prototypes === 0) return "This site has no prototypes yet: they come with its library.";
  if (editing.tool !== "select" || editing.chosen.size === 0) return HINTS[editing.tool];
  const [only] = editing.chosen;
  const one = editing.chosen.size === 1 && only !== undefined ? nameOf(editing.copy.now.get(only)) : whatIsChosen(editing);
  return one.charAt(0).toUpperCase() + one.slice(1);
}

/** A number as people type it, with a point or a comma; null if it is none. */
function numberIn(text: string): number | null {
  const value = Number(text.trim().replace(",", "."));
  return text.trim() === "" || !Number.isFinite(value) ? null : value;
}

function figureRow(store: Store, actions: EditActions): Row<Figure> {
  let figure: Figure | null = null;
  const label = el("span");
  const unit = el("span");
  const input = el("input", {
    attrs: { type: "number" },
    on: {
      change: () => {
        const value = numberIn(input.value);
        if (figure === null || value === null || (figure.min !== undefined && value < figure.min)) {
          input.value = String(figure?.value ?? "");
          return;
        }
        actions.change(figure.set(store.state().editing, value));
      },
    },
  });
  const element = el("label", {}, label, " ", input, " ", unit);
  return {
    element,
    draw: (now) => {
      figure = now;
      setText(label, now.label);
      setText(unit, now.unit);
      input.id = `edit-figure-${now.id}`;
      input.step = String(now.step);
      if (now.min !== undefined) input.min = String(now.min);
      if (document.activeElement !== input && input.value !== String(now.value ?? "")) input.value = String(now.value ?? "");
    },
  };
}
