// Which layers are shown, and how strongly.

import { el, setShown, setText } from "../dom";
import { HEIGHTS_M, MODEL_STATES, type ModelStateName } from "../model";
import { LAYER_NAMES, LAYER_TITLES, type LayerName } from "../layers";
import { EVIDENCE, type Evidence } from "../pyramid";
import type { State } from "../state";
import type { Store } from "../store";

const TITLES: Readonly<Record<Evidence, string>> = {
  all: "all layers",
  scanner: "scanners only",
  sonar: "sonar only",
  prior: "prior only",
};

const MODEL_TITLES: Readonly<Record<ModelStateName, string>> = { published: "as published", draft: "draft" };

/** The shades of the server's pictures. */
const SHADES = [
  { name: "free", title: "free" },
  { name: "occupied", title: "occupied" },
  { name: "sonar", title: "only by sonar" },
  { name: "prior", title: "only in the prior" },
] as const;

export function createLayersCard(parent: HTMLElement, store: Store): (state: State) => void {
  // The uppermost layer first, as one sees them.
  const rows = [...LAYER_NAMES].reverse().map((name) => createRow(name, store));
  const evidence = el(
    "select",
    {
      attrs: { "aria-label": "Evidence that is shown" },
      on: {
        change: () => {
          const chosen = EVIDENCE.find((value) => value === evidence.value);
          if (chosen !== undefined) store.dispatch({ kind: "evidence", evidence: chosen });
        },
      },
    },
    ...EVIDENCE.map((value) => el("option", { text: TITLES[value], attrs: { value } })),
  );
  const evidenceRow = el(
    "div",
    { class: "layer-options" },
    el("div", {}, el("span", { text: "show" }), evidence),
    el(
      "div",
      { class: "shades" },
      ...SHADES.map(({ name, title }) => el("span", {}, el("i", { class: `shade shade-${name}` }), title)),
    ),
  );
  rows.find(({ name }) => name === "raster")?.element.append(evidenceRow);
  const modelRow = createModelRow(store);
  rows.find(({ name }) => name === "model")?.element.append(modelRow.element);
  parent.append(
    el("section", { class: "card" }, el("h2", { text: "Layers" }), el("ul", { class: "layers" }, ...rows.map(({ element }) => element))),
  );

  return (state) => {
    for (const { draw } of rows) draw(state);
    if (evidence.value !== state.evidence) evidence.value = state.evidence;
    setShown(evidenceRow, state.layers.raster.on);
    modelRow.draw(state);
  };
}

/** At which height the model is cut, and which one. */
function createModelRow(store: Store): { element: HTMLElement; draw: (state: State) => void } {
  const height = el("input", {
    attrs: {
      type: "number",
      id: "model-height",
      min: String(HEIGHTS_M.min),
      max: String(HEIGHTS_M.max),
      step: String(HEIGHTS_M.step),
    },
    on: {
      change: () => {
        if (height.validity.valid && height.value !== "") store.dispatch({ kind: "model-view", view: { heightM: height.valueAsNumber } });
      },
    },
  });
  const which = el(
    "select",
    {
      attrs: { "aria-label": "Which model is shown" },
      on: {
        change: () => {
          const chosen = MODEL_STATES.find((value) => value === which.value);
          if (chosen !== undefined) store.dispatch({ kind: "model-view", view: { state: chosen } });
        },
      },
    },
    ...MODEL_STATES.map((value) => el("option", { text: MODEL_TITLES[value], attrs: { value } })),
  );
  const none = el("p", { class: "hint" });
  const element = el(
    "div",
    { class: "layer-options" },
    el("div", {}, el("label", { text: "cut at, m", attrs: { for: "model-height" } }), height),
    el("div", {}, el("span", { text: "show" }), which),
    none,
  );
  return {
    element,
    draw({ layers, model }) {
      const { view, readAs, revision, plan, problem } = model;
      if (document.activeElement !== height) height.value = String(view.heightM);
      if (which.value !== view.state) which.value = view.state;
      const nothing = revision === 0 ? "This level has no model yet." : plan === null ? "Nothing is published yet." : "";
      const words = problem ?? (readAs === null ? "" : nothing);
      setText(none, words);
      setShown(none, words !== "");
      setShown(element, layers.model.on && revision !== null);
    },
  };
}

function createRow(name: LayerName, store: Store): { name: LayerName; element: HTMLElement; draw: (state: State) => void } {
  const title = LAYER_TITLES[name];
  const on = el("input", {
    attrs: { type: "checkbox", id: `layer-${name}` },
    on: {
      change: () => {
        store.dispatch({ kind: "layer", name, setting: { on: on.checked } });
      },
    },
  });
  const opacity = el("input", {
    attrs: { type: "range", min: "10", max: "100", step: "5", "aria-label": `Opacity of ${title}` },
    on: {
      input: () => {
        store.dispatch({ kind: "layer", name, setting: { opacity: Number(opacity.value) / 100 } });
      },
    },
  });
  return {
    name,
    element: el("li", {}, on, el("label", { text: title, attrs: { for: `layer-${name}` } }), opacity),
    draw({ layers }) {
      const setting = layers[name];
      on.checked = setting.on;
      opacity.disabled = !setting.on;
      const percent = String(Math.round(setting.opacity * 100));
      if (opacity.value !== percent) opacity.value = percent;
      const title = `${percent} %`;
      if (opacity.title !== title) opacity.title = title;
    },
  };
}
