// The prior of the level: a map of another program below what robots see. Who may edit hands one in
// here, after seeing what the server read in it, or takes it away.

import { el, foldingHead, keyed, logRow, setShown, setText } from "../dom";
import { importInWords, priorOf, provenanceInWords, reportInWords } from "../imports";
import type { ImportActions } from "../importing";
import { mayRevert } from "../reverting";
import type { State } from "../state";
import type { Import } from "../wire";

export function createPriorCard(parent: HTMLElement, actions: ImportActions): (state: State) => void {
  const fileInput = (id: string, accept: string): HTMLInputElement =>
    el("input", {
      attrs: { type: "file", id, accept },
      on: {
        change: () => {
          actions.choose({});
        },
      },
    });
  const yaml = fileInput("prior-yaml", ".yaml,.yml");
  const image = fileInput("prior-image", ".pgm,.png");
  const trust = el("input", {
    attrs: { type: "range", id: "prior-trust", min: "0", max: "1", step: "0.05" },
    on: {
      input: () => {
        actions.choose({ trust: trust.valueAsNumber });
      },
    },
  });
  const trusted = el("output", { attrs: { for: "prior-trust" } });
  const files = (): File[] => [yaml, image].flatMap((input) => [...(input.files ?? [])]);
  const tryOut = el("button", {
    text: "What is in it?",
    attrs: { type: "button", id: "prior-preview" },
    on: {
      click: () => {
        actions.tryOut(files());
      },
    },
  });
  const told = el("dl", { class: "prior-told", attrs: { "aria-label": "What the server read" } });
  const warnings = el("ul", { class: "prior-warnings", attrs: { "aria-label": "What is doubtful" } });
  const confirm = el("button", { class: "primary", text: "Make it the prior", attrs: { type: "submit", id: "prior-confirm" } });
  const cancel = el("button", {
    text: "Cancel",
    attrs: { type: "button" },
    on: {
      click: () => {
        actions.choose({});
      },
    },
  });
  const decision = el("div", { class: "buttons" }, confirm, cancel);
  const form = el(
    "form",
    {
      class: "prior-form",
      on: {
        submit: (event) => {
          event.preventDefault();
          actions.confirm(files());
        },
      },
    },
    el("label", { text: "YAML", attrs: { for: "prior-yaml" } }),
    yaml,
    el("label", { text: "Image", attrs: { for: "prior-image" } }),
    image,
    el("label", { text: "Trust", attrs: { for: "prior-trust" } }),
    el("div", { class: "prior-trust" }, trust, trusted),
    tryOut,
    told,
    warnings,
    decision,
  );
  const barred = el("p", { class: "hint", text: "To import a map, sign in with a token that has the scope map:edit." });
  const busy = el("p", { class: "hint", attrs: { role: "status" } });
  const problem = el("p", { class: "problem", attrs: { role: "alert" } });
  const done = el("p", { class: "done", attrs: { role: "status" } });
  const now = el("p", { class: "prior-now" });
  const remove = el("button", { text: "Take away", attrs: { type: "button", id: "prior-remove" }, on: { click: actions.remove } });
  const list = el("ul", { class: "imports", attrs: { "aria-label": "Imports, newest first" } });
  const drawList = keyed<Import>(list, { key: ({ id }) => id, make: (made) => logRow(importInWords(made), provenanceInWords(made)) });
  const details = el(
    "details",
    {},
    foldingHead("Prior", () => {
      actions.open(!details.open);
    }),
    el("div", { class: "folding-head" }, now, remove),
    form,
    barred,
    busy,
    problem,
    done,
    list,
  );
  parent.append(el("section", { class: "card folding prior-card" }, details));
  let drawn: unknown = null;
  let place = "";

  return (state) => {
    const { imports } = state;
    // What was chosen for one level must not go into another.
    const here = `${state.place?.site}/${state.place?.level}`;
    if (here !== place) {
      place = here;
      form.reset();
    }
    if (details.open !== imports.open) details.open = imports.open;
    const [may, prior] = [mayRevert(state), priorOf(imports.imports)];
    setShown(form, may);
    setShown(barred, !may);
    setShown(remove, may && prior !== null);
    setText(now, imports.imports === null ? "Asking for the imports …" : prior === null ? "There is none." : importInWords(prior));
    if (trust.valueAsNumber !== imports.trust) trust.value = String(imports.trust);
    setText(trusted, imports.trust.toFixed(2));
    const working = imports.busy !== null;
    const chosen = (yaml.files?.length ?? 0) > 0 && (image.files?.length ?? 0) > 0;
    setShown(tryOut, imports.told === null);
    tryOut.disabled = working || !chosen;
    tryOut.title = chosen ? "" : "Choose a YAML and its image first";
    confirm.disabled = working;
    remove.disabled = working;
    if (imports.told !== drawn) {
      drawn = imports.told;
      const lines = imports.told === null ? [] : reportInWords(imports.told);
      told.replaceChildren(...lines.flatMap(([name, value]) => [el("dt", { text: name }), el("dd", { text: value })]));
      warnings.replaceChildren(...(imports.told?.warnings ?? []).map((text) => el("li", { text })));
    }
    setShown(told, imports.told !== null);
    setShown(warnings, (imports.told?.warnings ?? []).length > 0);
    setShown(decision, imports.told !== null);
    for (const [line, text] of [[busy, imports.busy], [problem, imports.problem], [done, imports.done]] as const) {
      setShown(line, text !== null);
      setText(line, text ?? "");
    }
    drawList(imports.imports ?? []);
  };
}
