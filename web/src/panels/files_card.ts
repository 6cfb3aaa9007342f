// Models out of files: buildings, drawings, models in space and maps, taken into the draft by who may edit, after seeing what
// the server read in them.

import { el, foldingHead, setShown, setText } from "../dom";
import { doubtsInWords, sendingOf, toldInWords } from "../model_files";
import { mayRevert } from "../reverting";
import type { State } from "../state";
import type { FileActions } from "../taking";

const ACCEPT = ".yaml,.yml,.dxf,.glb,.json,.jsonfg,.geojson,.zip,.pgm,.png";

export function createFilesCard(parent: HTMLElement, actions: FileActions): (state: State) => void {
  const input = el("input", {
    attrs: { type: "file", id: "model-files", accept: ACCEPT, multiple: "" },
    on: {
      change: () => {
        actions.choose({});
      },
    },
  });
  const files = (): File[] => [...(input.files ?? [])];
  const level = el("input", {
    attrs: { type: "text", id: "model-file-level", placeholder: "if it has several" },
    on: {
      input: () => {
        actions.choose({ level: level.value.trim() });
      },
    },
  });
  const unit = el("input", {
    attrs: { type: "text", id: "model-file-unit", inputmode: "decimal", placeholder: "as it says" },
    on: {
      input: () => {
        actions.choose({ unit: unit.value.trim() });
      },
    },
  });
  const replace = el("input", {
    attrs: { type: "checkbox", id: "model-file-replace" },
    on: {
      change: () => {
        actions.choose({ replace: replace.checked });
      },
    },
  });
  const tryOut = el("button", {
    text: "What is in it?",
    attrs: { type: "button", id: "model-file-preview" },
    on: {
      click: () => {
        actions.tryOut(files());
      },
    },
  });
  const told = el("dl", { class: "prior-told", attrs: { "aria-label": "What the server read" } });
  const doubts = el("ul", { class: "prior-warnings", attrs: { "aria-label": "What is left out or doubtful" } });
  const confirm = el("button", { class: "primary", text: "Take it into the draft", attrs: { type: "submit", id: "model-file-confirm" } });
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
  const labelOf = (name: string, of: HTMLElement): HTMLElement => el("label", { text: name, attrs: { for: of.id } });
  const levelRow = [labelOf("Level of the building", level), level];
  const unitRow = [labelOf("Metres of one unit", unit), unit];
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
    labelOf("File", input),
    input,
    ...levelRow,
    ...unitRow,
    el("label", { class: "whole", attrs: { for: replace.id } }, replace, " in the place of all that the draft has"),
    tryOut,
    told,
    doubts,
    decision,
  );
  const hint = el("p", {
    class: "hint",
    text: "Open-RMF building.yaml, DXF, GLB, JSON-FG, GeoJSON; or a map of map_server (YAML and image, or both in a zip), whose occupied cells become walls.",
  });
  const barred = el("p", { class: "hint", text: "To take models in, sign in with a token that has the scope map:edit." });
  const busy = el("p", { class: "hint", attrs: { role: "status" } });
  const problem = el("p", { class: "problem", attrs: { role: "alert" } });
  const done = el("p", { class: "done", attrs: { role: "status" } });
  const details = el(
    "details",
    {},
    foldingHead("Model from a file", () => {
      actions.open(!details.open);
    }),
    hint,
    form,
    barred,
    busy,
    problem,
    done,
  );
  parent.append(el("section", { class: "card folding files-card" }, details));
  let drawn: unknown = null;
  let place = "";

  return (state) => {
    const now = state.files;
    // What was chosen for one level must not go into another.
    const here = `${state.place?.site}/${state.place?.level}`;
    if (here !== place) {
      place = here;
      form.reset();
    }
    if (details.open !== now.open) details.open = now.open;
    const may = mayRevert(state);
    setShown(form, may);
    setShown(barred, !may);
    const sending = sendingOf(files().map(({ name }) => name), now);
    for (const part of levelRow) setShown(part, sending?.mediaType === "application/yaml");
    for (const part of unitRow) setShown(part, sending?.mediaType === "image/vnd.dxf");
    const working = now.busy !== null;
    setShown(tryOut, now.told === null);
    tryOut.disabled = working || sending === null;
    tryOut.title = sending === null ? "Choose a model's file, or a map's YAML and its image" : "";
    confirm.disabled = working;
    if (now.told !== drawn) {
      drawn = now.told;
      const lines = now.told === null ? [] : toldInWords(now.told);
      told.replaceChildren(...lines.flatMap(([name, value]) => [el("dt", { text: name }), el("dd", { text: value })]));
      doubts.replaceChildren(...(now.told === null ? [] : doubtsInWords(now.told)).map((text) => el("li", { text })));
    }
    setShown(told, now.told !== null);
    setShown(doubts, doubts.childElementCount > 0);
    setShown(decision, now.told !== null);
    for (const [line, text] of [[busy, now.busy], [problem, now.problem], [done, now.done]] as const) {
      setShown(line, text !== null);
      setText(line, text ?? "");
    }
  };
}
