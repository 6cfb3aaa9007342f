// The model in space over the map, while it is asked for: loads what draws it the first time, and says so if it cannot.

import type { EditActions } from "../editing/acting";
import { shownObjects } from "../editing";
import { chosenAfter } from "../editing/choosing";
import { unsent } from "../editing/history";
import { whatIsChosen } from "../editing/pointing";
import { el, setShown, setText } from "../dom";
import { memo } from "../memo";
import type { Theme } from "../palette";
import type { SpaceView } from "../space/view";
import type { State } from "../state";
import type { Store } from "../store";

export interface SpacePanelOptions {
  parent: HTMLElement;
  store: Store;
  actions: EditActions;
  theme: () => Theme;
  /** How many objects are drawn, or how far it has come. */
  onShown: (what: string) => void;
}

export function createSpacePanel({ parent, store, actions, theme, onShown }: SpacePanelOptions): (state: State) => void {
  const said = el("p", { class: "space-said hint", attrs: { role: "status" } });
  const chosen = el("p", { class: "space-chosen", attrs: { role: "status" } });
  const space = el("section", { class: "space", attrs: { "aria-label": "The draft in space" } }, said, chosen);
  parent.prepend(space);
  let view: SpaceView | null = null;
  let isLoading = false;
  let problem: string | null = null;
  const unsentOf = memo((copy: State["editing"]["copy"]) => (copy === null ? new Map<string, unknown>() : unsent(copy)));
  const objectsOf = memo((copy: State["editing"]["copy"], sketch: State["editing"]["sketch"]) => shownObjects({ ...store.state().editing, copy, sketch }));

  const load = async (): Promise<void> => {
    isLoading = true;
    try {
      const { createSpaceView } = await import("../space/view");
      view = createSpaceView({
        target: space,
        onChoose: (id, several) => {
          const { editing } = store.state();
          actions.change({ chosen: chosenAfter(editing.chosen, id, several || editing.several) });
        },
      });
    } catch {
      problem = "This browser cannot draw in space: it has no WebGL, or the server is out of reach.";
    }
    isLoading = false;
    draw(store.state());
  };

  const draw = (state: State): void => {
    const { editing } = state;
    setShown(space, editing.is3d);
    if (!editing.is3d) {
      view?.dispose();
      view = null;
      problem = null;
      onShown("");
      return;
    }
    if (view === null && !isLoading && problem === null) void load();
    const { copy } = editing;
    const wait = copy === null ? (editing.problem ?? "Asking for the draft …") : view === null ? "Loading the view …" : copy.now.size === 0 ? "The draft is empty." : null;
    setShown(said, (problem ?? wait) !== null);
    setText(said, problem ?? wait ?? "");
    setShown(chosen, editing.chosen.size > 0);
    setText(chosen, whatIsChosen(editing));
    if (view === null || copy === null) return;
    // What is under the pointer on the map is not in the model.
    const sketch = editing.sketch.kind === "drag" ? editing.sketch : { kind: "none" as const };
    view.draw({ objects: sketch.kind === "none" ? copy.now : objectsOf(copy, sketch), library: editing.library, chosen: editing.chosen, unsent: unsentOf(copy), theme: theme() });
    onShown(String(copy.now.size));
  };
  return draw;
}
