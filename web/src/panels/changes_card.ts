// What robots found against the published model: each change with its evidence, to be accepted or dismissed.

import { changeInWords, evidenceInWords, KIND_WORDS, middleOf, sorted, waiting } from "../changes";
import { mayAnswer, type ChangeActions } from "../changing";
import { el, foldingHead, setShown, setText } from "../dom";
import type { State } from "../state";
import type { Store } from "../store";
import type { ModelChange, ModelChangeAnswer } from "../wire";
import { count, counted } from "../words";

/** Changes that are listed. */
const SHOWN = 100;
/** Metres per pixel at which a change is shown. */
const NEAR = 0.01;

/** What can be answered to a change, as buttons say it. */
const ANSWERS: Readonly<Record<ModelChange["state"], readonly (readonly [ModelChangeAnswer, string])[]>> = {
  open: [
    ["accept", "Accept"],
    ["dismiss", "Dismiss"],
  ],
  accepted: [],
  dismissed: [["reopen", "Tell again"]],
};

export function createChangesCard(parent: HTMLElement, { store, actions }: { store: Store; actions: ChangeActions }): (state: State) => void {
  const now = el("p", { class: "changes-now", attrs: { role: "status" } });
  const barred = el("p", { class: "hint", text: "To answer, sign in with a token that has the scope map:edit." });
  const problem = el("p", { class: "problem", attrs: { role: "alert" } });
  const done = el("p", { class: "done", attrs: { role: "status" } });
  const list = el("ul", { class: "model-changes", attrs: { "aria-label": "What robots found against the model" } });
  const more = el("p", { class: "hint" });
  const details = el(
    "details",
    {},
    foldingHead("Changes", () => {
      actions.open(!details.open);
    }),
    el("div", { class: "folding-head" }, now),
    barred,
    problem,
    done,
    list,
    more,
  );
  parent.append(el("section", { class: "card folding changes-card" }, details));
  let drawn: readonly unknown[] = [];

  return (state) => {
    const { changes } = state;
    if (details.open !== changes.open) details.open = changes.open;
    const may = mayAnswer(state);
    setText(now, waiting(changes));
    setShown(barred, !may && (changes.list ?? []).length > 0);
    for (const [line, text] of [[problem, changes.problem], [done, changes.done]] as const) {
      setShown(line, text !== null);
      setText(line, text ?? "");
    }
    const drawnFrom = [changes.list, changes.answering, may];
    if (drawnFrom.some((value, index) => value !== drawn[index])) {
      drawn = drawnFrom;
      const all = sorted(changes.list ?? []);
      const row = (change: ModelChange): HTMLElement => createRow(change, { store, actions, may, busy: changes.answering !== null, nowMs: state.nowMs });
      list.replaceChildren(...all.slice(0, SHOWN).map(row));
      setText(more, `and ${count(Math.max(all.length - SHOWN, 0))} more of ${counted(all.length, "change")}`);
      setShown(more, all.length > SHOWN);
    }
  };
}

interface RowOptions {
  store: Store;
  actions: ChangeActions;
  may: boolean;
  busy: boolean;
  nowMs: number;
}

function createRow(change: ModelChange, { store, actions, may, busy, nowMs }: RowOptions): HTMLElement {
  const at = middleOf(change);
  const show = el("button", {
    class: "show",
    text: "Show",
    attrs: { type: "button" },
    on: {
      click: () => {
        if (at !== null) store.dispatch({ kind: "view", view: { kind: "at", xLevelM: at[0], yLevelM: at[1], resolution: NEAR } });
      },
    },
  });
  const answers = (may ? ANSWERS[change.state] : []).map(([answer, text]) => {
    const button = el("button", {
      class: answer,
      text,
      attrs: { type: "button", "aria-label": `${text}: ${changeInWords(change)}` },
      on: {
        click: () => {
          actions.answer(change, answer);
        },
      },
    });
    button.disabled = busy;
    return button;
  });
  return el(
    "li",
    { class: `model-change change-${change.kind} is-${change.state}`, attrs: { "data-change": change.id } },
    el("span", { class: "change-kind", text: KIND_WORDS[change.kind] }),
    el("span", { class: "name", text: changeInWords(change) }),
    el("span", { class: "evidence", text: evidenceInWords(change, nowMs) }),
    el("span", { class: "answers" }, show, ...answers),
  );
}
