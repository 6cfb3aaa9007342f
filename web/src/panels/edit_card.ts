// What has been edited and is not in the draft yet: sending it, what others did meanwhile, what no longer fits, and what
// would be wrong with the model.

import { clashInWords, standInWords, unsentCount } from "../editing";
import type { EditActions } from "../editing/acting";
import { boxOf } from "../editing/objects";
import { placeOf } from "../drafts";
import { el, keyed, setShown, setText, type Row } from "../dom";
import type { Clash } from "../editing/rebasing";
import type { State } from "../state";
import type { Store } from "../store";
import type { GdbFinding } from "../wire";
import { counted } from "../words";

/** Findings that are listed. */
const FINDINGS_SHOWN = 50;
/** Metres per pixel at which a finding or a clash is shown. */
const NEAR = 0.02;

export interface EditCardOptions {
  store: Store;
  actions: EditActions;
}

export function createEditCard(parent: HTMLElement, { store, actions }: EditCardOptions): (state: State) => void {
  const now = el("p", { class: "edit-now", attrs: { role: "status" } });
  const comment = el("input", {
    attrs: { id: "edit-comment", type: "text", maxlength: "200", placeholder: "What for (optional)", "aria-label": "What the edits are for" },
    on: {
      input: () => {
        actions.change({ comment: comment.value });
      },
    },
  });
  const send = el("button", { class: "primary", text: "Send to the draft", attrs: { type: "button", id: "edit-send", title: "Make it the draft (Ctrl+S)" }, on: { click: actions.send } });
  const discard = el("button", {
    text: "Discard",
    attrs: { type: "button", id: "edit-discard", title: "Give up all that is not in the draft" },
    on: {
      click: () => {
        if (window.confirm("Give up all edits that are not in the draft?")) actions.discard();
      },
    },
  });
  const problem = el("p", { class: "problem", attrs: { role: "alert" } });
  const done = el("p", { class: "done", attrs: { role: "status" } });
  const news = el("ul", { class: "edit-news", attrs: { "aria-label": "What others did" } });
  const clashes = el("ul", { class: "edit-clashes", attrs: { "aria-label": "Edits that no longer fit" } });
  const drawClashes = keyed<Clash>(clashes, { key: ({ id }) => id, make: (clash) => clashRow(clash, store, actions) });
  const found = el("p", { class: "hint edit-found", attrs: { role: "status" } });
  const findings = el("ul", { class: "findings", attrs: { "aria-label": "What would be wrong with the model" } });
  const card = el(
    "section",
    { class: "card edit-card" },
    el("h2", { text: "Edits" }),
    now,
    problem,
    done,
    el("div", { class: "edit-send" }, comment, el("div", { class: "buttons" }, send, discard)),
    news,
    clashes,
    found,
    findings,
  );
  parent.prepend(card);
  let [drawnNews, drawnFindings] = [null as readonly string[] | null, null as readonly GdbFinding[] | null];

  return (state) => {
    const { editing } = state;
    setShown(card, editing.on);
    if (!editing.on) return;
    const unsent = unsentCount(editing);
    setText(now, editing.busy ?? standInWords(editing));
    send.disabled = editing.busy !== null || unsent === 0;
    discard.disabled = editing.busy !== null || (unsent === 0 && editing.clashes.length === 0);
    if (comment.value !== editing.comment) comment.value = editing.comment;
    for (const [line, text] of [[problem, editing.problem], [done, editing.done]] as const) {
      setShown(line, text !== null);
      setText(line, text ?? "");
    }
    if (editing.news !== drawnNews) {
      drawnNews = editing.news;
      news.replaceChildren(...editing.news.map((text) => el("li", { text })));
    }
    setShown(news, editing.news.length > 0);
    setShown(clashes, editing.clashes.length > 0);
    drawClashes(editing.clashes);
    const list = editing.findings;
    if (list !== drawnFindings) {
      drawnFindings = list;
      const sorted = [...(list ?? [])].sort((a, b) => Number(b.severity === "error") - Number(a.severity === "error"));
      findings.replaceChildren(...sorted.slice(0, FINDINGS_SHOWN).map((finding) => findingRow(finding, store, actions)));
    }
    setText(found, editing.copy === null ? "" : list === null ? "Looking for faults …" : list.length === 0 ? "No faults." : `${counted(list.length, "finding")}:`);
    setShown(findings, list !== null && list.length > 0);
  };
}

function clashRow(clash: Clash, store: Store, actions: EditActions): Row<Clash> {
  const text = el("span", { class: "name" });
  const button = (word: string, title: string, click: () => void): HTMLButtonElement => el("button", { text: word, attrs: { type: "button", title }, on: { click } });
  const { id } = clash;
  const show = button("Show", "Show it on the map", () => {
    showObject(store, actions, id);
  });
  const mine = button("Take mine", "Put your version in its place; it can be taken back", () => {
    actions.takeMine(id);
  });
  const theirs = button("Drop mine", "Leave it as the draft has it", () => {
    actions.dropMine(id);
  });
  const element = el("li", {}, text, el("span", { class: "buttons" }, show, mine, theirs));
  return {
    element,
    draw: (now) => {
      setText(text, clashInWords(now));
    },
  };
}

/** Chooses an object and moves the map to it. */
function showObject(store: Store, actions: EditActions, id: string): void {
  const { editing } = store.state();
  const object = editing.copy?.now.get(id) ?? editing.clashes.find((clash) => clash.id === id)?.mine;
  const box = object == null ? null : boxOf(object, editing.library);
  if (editing.copy?.now.has(id) === true) actions.change({ tool: "select", chosen: new Set([id]), sketch: { kind: "none" } });
  if (box === null) return;
  store.dispatch({ kind: "view", view: { kind: "at", xLevelM: (box[0] + box[2]) / 2, yLevelM: (box[1] + box[3]) / 2, resolution: NEAR } });
}

function findingRow(finding: GdbFinding, store: Store, actions: EditActions): HTMLElement {
  const place = placeOf(finding);
  const { object } = finding;
  const text = el("span", { class: "name", text: finding.detail });
  const severity = el("span", { class: `severity severity-${finding.severity}`, text: finding.severity });
  if (place === null && object == null) return el("li", {}, severity, text);
  const show = el("button", {
    class: "show",
    text: "show",
    attrs: { type: "button" },
    on: {
      click: () => {
        if (object != null) showObject(store, actions, object);
        if (place !== null) store.dispatch({ kind: "view", view: { kind: "at", xLevelM: place[0], yLevelM: place[1], resolution: NEAR } });
      },
    },
  });
  return el("li", {}, severity, text, show);
}
