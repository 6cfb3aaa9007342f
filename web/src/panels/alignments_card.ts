// Robots that came with maps in frames of their own: where these seem to lie on the level, to be accepted or withdrawn.

import { alignmentInWords, candidateInWords, certaintyInWords, frameInWords, heldInWords, poseInWords, waitingInWords } from "../alignments";
import { mayAlign, type AlignmentActions } from "../aligning";
import { el, foldingHead, setShown, setText } from "../dom";
import type { State } from "../state";
import type { Store } from "../store";
import type { Alignment, UnalignedFrame, UncertainPose } from "../wire";

/** Places of a frame that are offered. */
const OFFERED = 3;
/** Metres per pixel at which a place is shown: some tens of metres round it. */
const AROUND = 0.05;

interface RowOptions {
  store: Store;
  actions: AlignmentActions;
  may: boolean;
  busy: boolean;
  nowMs: number;
}

export function createAlignmentsCard(parent: HTMLElement, { store, actions }: { store: Store; actions: AlignmentActions }): (state: State) => void {
  const now = el("p", { class: "alignments-now", attrs: { role: "status" } });
  const barred = el("p", { class: "hint", text: "To say where a frame lies, sign in with a token that has the scope map:edit." });
  const problem = el("p", { class: "problem", attrs: { role: "alert" } });
  const done = el("p", { class: "done", attrs: { role: "status" } });
  const frames = el("ul", { class: "frames", attrs: { "aria-label": "Frames that wait for a place" } });
  const log = el("ul", { class: "frames", attrs: { "aria-label": "Frames that have a place, or had one" } });
  const details = el(
    "details",
    {},
    foldingHead("Own frames", () => {
      actions.open(!details.open);
    }),
    el("div", { class: "folding-head" }, now),
    barred,
    problem,
    done,
    frames,
    log,
  );
  parent.append(el("section", { class: "card folding alignments-card" }, details));
  let drawn: readonly unknown[] = [];

  return (state) => {
    const { alignments } = state;
    if (details.open !== alignments.open) details.open = alignments.open;
    const may = mayAlign(state);
    setText(now, waitingInWords(alignments));
    setShown(barred, !may && (alignments.unaligned ?? []).length > 0);
    for (const [line, text] of [[problem, alignments.problem], [done, alignments.done]] as const) {
      setShown(line, text !== null);
      setText(line, text ?? "");
    }
    const drawnFrom = [alignments.unaligned, alignments.alignments, alignments.answering, may];
    if (drawnFrom.some((value, index) => value !== drawn[index])) {
      drawn = drawnFrom;
      const options = { store, actions, may, busy: alignments.answering !== null, nowMs: state.nowMs };
      frames.replaceChildren(...(alignments.unaligned ?? []).map((frame) => frameRow(frame, options)));
      log.replaceChildren(...alignments.alignments.map((alignment) => alignmentRow(alignment, options)));
    }
  };
}

/** A frame that waits, with the places that it may have. */
function frameRow(frame: UnalignedFrame, options: RowOptions): HTMLElement {
  const places = frame.candidates.slice(0, OFFERED).map((candidate) => {
    const where = poseInWords(candidate.pose);
    const accept = button("Accept", `Accept: ${frameInWords(frame.frame)} at ${where}`, options, () => {
      options.actions.accept(frame.frame, candidate.pose);
    });
    return el(
      "li",
      { class: "place" },
      el("span", { class: "name", text: where }),
      el("span", { class: "evidence", text: candidateInWords(candidate) }),
      el("span", { class: "answers" }, show(candidate.pose, options), ...(options.may ? [accept] : [])),
    );
  });
  return el(
    "li",
    { class: `frame ${frame.is_certain ? "is-certain" : "is-doubtful"}`, attrs: { "data-frame": frame.frame } },
    el("span", { class: "name", text: heldInWords(frame) }),
    el("span", { class: "certainty", text: certaintyInWords(frame) }),
    el("ul", { class: "places" }, ...places),
  );
}

/** An alignment of the log. */
function alignmentRow(alignment: Alignment, options: RowOptions): HTMLElement {
  const { frame, pose, withdrawn } = alignment;
  const stands = withdrawn == null;
  const withdraw = button("Withdraw", `Withdraw: ${frameInWords(frame)}`, options, () => {
    options.actions.withdraw(frame);
  });
  return el(
    "li",
    { class: `frame ${stands ? "is-aligned" : "is-withdrawn"}`, attrs: { "data-frame": frame } },
    el("span", { class: "name", text: frameInWords(frame) }),
    el("span", { class: "evidence", text: alignmentInWords(alignment, options.nowMs) }),
    el("span", { class: "answers" }, show(pose, options), ...(stands && options.may ? [withdraw] : [])),
  );
}

function show({ x_m: x, y_m: y }: UncertainPose, { store }: RowOptions): HTMLElement {
  return el("button", {
    class: "show",
    text: "Show",
    attrs: { type: "button" },
    on: {
      click: () => {
        store.dispatch({ kind: "view", view: { kind: "at", xLevelM: x, yLevelM: y, resolution: AROUND } });
      },
    },
  });
}

function button(text: string, label: string, { busy }: RowOptions, click: () => void): HTMLElement {
  const made = el("button", { class: text.toLowerCase(), text, attrs: { type: "button", "aria-label": label }, on: { click } });
  made.disabled = busy;
  return made;
}
