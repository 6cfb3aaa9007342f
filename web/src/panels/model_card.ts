// The a-priori model of the level: who edited it, what is wrong with its draft, and handing it to the robots.

import { mayPublish, type DraftActions } from "../drafting";
import { entryInWords, entryProvenance, placeOf, readiness, READINESS_WORDS } from "../drafts";
import { unsentCount } from "../editing";
import { el, foldingHead, keyed, logRow, setShown, setText } from "../dom";
import type { State } from "../state";
import type { Store } from "../store";
import type { GdbEntry, GdbFinding } from "../wire";
import { count, counted } from "../words";

/** Findings that are listed. */
const FINDINGS_SHOWN = 50;
/** Metres per pixel at which a finding is shown. */
const NEAR = 0.02;

export function createModelCard(parent: HTMLElement, { store, actions }: { store: Store; actions: DraftActions }): (state: State) => void {
  const now = el("p", { class: "model-now", attrs: { role: "status" } });
  const publish = el("button", { class: "primary", text: "Publish", attrs: { type: "button", id: "model-publish" }, on: { click: actions.publish } });
  const barred = el("p", { class: "hint", text: "To publish, sign in with a token that has the scope map:publish." });
  const unsent = el("p", { class: "hint", text: "What is edited and not in the draft yet would not be published: send it first." });
  const problem = el("p", { class: "problem", attrs: { role: "alert" } });
  const done = el("p", { class: "done", attrs: { role: "status" } });
  const findings = el("ul", { class: "findings", attrs: { "aria-label": "What is wrong with the draft" } });
  const more = el("p", { class: "hint" });
  const list = el("ul", { class: "imports", attrs: { "aria-label": "Edits and publications, newest first" } });
  const drawEntries = keyed<GdbEntry>(list, { key: ({ id }) => id, make: (entry) => logRow(entryInWords(entry), entryProvenance(entry)) });
  const details = el(
    "details",
    {},
    foldingHead("Model", () => {
      actions.open(!details.open);
    }),
    el("div", { class: "folding-head" }, now, publish),
    barred,
    unsent,
    problem,
    done,
    findings,
    more,
    list,
  );
  parent.append(el("section", { class: "card folding model-card" }, details));
  let drawn: readonly GdbFinding[] | null = null;

  return (state) => {
    const { draft } = state;
    if (details.open !== draft.open) details.open = draft.open;
    const [may, ready] = [mayPublish(state), readiness(draft)];
    setText(now, draft.busy ?? READINESS_WORDS[ready]);
    setShown(publish, may && ready !== "no-model" && ready !== "unknown");
    publish.disabled = draft.busy !== null || ready !== "ready";
    setShown(barred, !may);
    setShown(unsent, may && unsentCount(state.editing) > 0);
    for (const [line, text] of [[problem, draft.problem], [done, draft.done]] as const) {
      setShown(line, text !== null);
      setText(line, text ?? "");
    }
    const found = draft.findings?.list ?? [];
    if (found !== drawn) {
      drawn = found;
      const shown = [...found].sort((a, b) => Number(b.severity === "error") - Number(a.severity === "error")).slice(0, FINDINGS_SHOWN);
      findings.replaceChildren(...shown.map((finding) => createFinding(finding, store)));
      setText(more, found.length > FINDINGS_SHOWN ? `and ${count(found.length - FINDINGS_SHOWN)} more of ${counted(found.length, "finding")}` : "");
      setShown(more, found.length > FINDINGS_SHOWN);
    }
    setShown(findings, found.length > 0);
    drawEntries(draft.entries ?? []);
  };
}

function createFinding(finding: GdbFinding, store: Store): HTMLElement {
  const place = placeOf(finding);
  const text = el("span", { class: "name", text: finding.detail });
  const severity = el("span", { class: `severity severity-${finding.severity}`, text: finding.severity });
  if (place === null) return el("li", {}, severity, text);
  const show = el("button", {
    class: "show",
    text: "show",
    attrs: { type: "button" },
    on: {
      click: () => {
        store.dispatch({ kind: "view", view: { kind: "at", xLevelM: place[0], yLevelM: place[1], resolution: NEAR } });
      },
    },
  });
  return el("li", {}, severity, text, show);
}
