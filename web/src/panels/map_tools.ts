// What lies on the map itself: zooming, the scale bar, the place under the pointer.

import { mayEdit, type EditActions } from "../editing/acting";
import { el, setShown, setText } from "../dom";
import { scaleBar } from "../scale";
import type { State } from "../state";
import type { Store } from "../store";
import { coordinate, lengthInWords } from "../words";

/** Longest scale bar. */
const SCALE_MOST_PX = 130;
/** What one press on + or - does. */
export const ZOOM_STEP = 1.6;

export interface MapToolsOptions {
  parent: HTMLElement;
  store: Store;
  onZoom: (factor: number) => void;
  edit: Pick<EditActions, "start" | "stop" | "turnSpace">;
}

export function createMapTools({ parent, store, onZoom, edit }: MapToolsOptions): (state: State) => void {
  const tool = (text: string, title: string, click: () => void): HTMLButtonElement =>
    el("button", { text, attrs: { type: "button", title, "aria-label": title }, on: { click } });
  const nearer = tool("+", "Zoom in (+)", () => {
    onZoom(ZOOM_STEP);
  });
  const further = tool("\u2212", "Zoom out (\u2212)", () => {
    onZoom(1 / ZOOM_STEP);
  });
  const fit = tool("Fit", "Show the whole level and keep it so (F)", () => {
    store.dispatch({ kind: "view", view: { kind: "fit" } });
  });
  const grid = tool("Grid", "Show or hide the grid (G)", () => {
    store.dispatch({ kind: "layer", name: "grid", setting: { on: !store.state().layers.grid.on } });
  });
  const editing = tool("Edit", "Edit the draft of the model (E)", () => {
    if (store.state().editing.on) edit.stop();
    else edit.start();
  });
  editing.id = "edit-model";
  const space = tool("3D", "Show the draft of the model in space (3)", edit.turnSpace);
  space.id = "show-3d";
  const tools = el(
    "div",
    { class: "tools", attrs: { role: "toolbar", "aria-label": "Map" } },
    nearer,
    further,
    fit,
    grid,
    editing,
    space,
  );
  const bar = el("span", { class: "bar" });
  const barText = el("span");
  const pointer = el("output", { class: "pointer", attrs: { "aria-label": "Position under the pointer" } });
  const foot = el("div", { class: "foot" }, el("span", { class: "scale" }, bar, barText), pointer);
  parent.append(tools, foot);

  return (state) => {
    const shown = state.place !== null;
    setShown(tools, shown);
    setShown(foot, shown && !state.editing.is3d);
    fit.setAttribute("aria-pressed", String(state.view.kind === "fit"));
    grid.setAttribute("aria-pressed", String(state.layers.grid.on));
    editing.setAttribute("aria-pressed", String(state.editing.on));
    setShown(editing, mayEdit(state));
    space.setAttribute("aria-pressed", String(state.editing.is3d));
    // They are about the map.
    for (const one of [fit, grid, nearer, further]) one.disabled = state.editing.is3d;
    const { lengthM, lengthPx } = scaleBar(state.shownResolution, SCALE_MOST_PX);
    bar.style.width = `${lengthPx.toFixed(1)}px`;
    setText(barText, lengthInWords(lengthM));
    setShown(pointer, state.pointer !== null);
    if (state.pointer !== null) {
      const [x, y] = state.pointer;
      setText(pointer, `x ${coordinate(x)}   y ${coordinate(y)}`);
    }
  };
}
