// Which contributions to take out, what that would change, why, and the button that does it.

import { el, setShown, setText } from "../dom";
import { mayRevert, nameOf, shownPreview } from "../reverting";
import { instantOf, targetsInWords, targetsOf } from "../reverts";
import type { State } from "../state";
import type { LogPanelOptions } from "./log_panel";

/** Longest reason that the server takes, bytes. */
const REASON_MOST = 500;
/** Room around what would change, when it is shown. */
const ROOM = 1.3;

export function createRevertForm({ store, actions }: LogPanelOptions): {
  element: HTMLElement;
  draw: (state: State) => void;
} {
  const instantInput = (id: "from" | "to"): HTMLInputElement => {
    const input = el("input", {
      attrs: { type: "datetime-local", step: "1", id: `log-${id}` },
      on: {
        input: () => {
          actions.choose({ [id]: input.value });
        },
      },
    });
    return input;
  };
  const [from, to] = [instantInput("from"), instantInput("to")];
  const span = el(
    "div",
    { class: "log-span" },
    el("label", { text: "Seen from", attrs: { for: "log-from" } }),
    from,
    el("label", { text: "and before", attrs: { for: "log-to" } }),
    to,
  );
  const meant = el("p", { class: "hint" });
  const tryOut = el("button", {
    text: "What would change?",
    attrs: { type: "button", id: "log-preview" },
    on: {
      click: () => {
        actions.tryOut({ kind: "revert" });
      },
    },
  });
  const told = el("div", { class: "told" });
  const show = el("button", {
    class: "quiet",
    text: "Show where",
    attrs: { type: "button" },
    on: {
      click: () => {
        showBounds(store.state(), store.dispatch);
      },
    },
  });
  const reason = el("input", {
    attrs: { type: "text", id: "log-reason", maxlength: String(REASON_MOST), autocomplete: "off" },
    on: {
      input: () => {
        store.dispatch({ kind: "log", log: { reason: reason.value } });
      },
    },
  });
  const why = el("div", { class: "log-why" }, el("label", { text: "Reason", attrs: { for: "log-reason" } }), reason);
  const confirm = el("button", { class: "primary", attrs: { type: "submit", id: "log-confirm" } });
  const cancel = el("button", { text: "Cancel", attrs: { type: "button" }, on: { click: actions.cancel } });
  const decision = el("div", { class: "buttons" }, confirm, cancel, show);
  const busy = el("p", { class: "hint", attrs: { role: "status" } });
  const problem = el("p", { class: "problem", attrs: { role: "alert" } });
  const done = el("p", { class: "done", attrs: { role: "status" } });
  const form = el(
    "form",
    {
      on: {
        submit: (event) => {
          event.preventDefault();
          actions.confirm();
        },
      },
    },
    span,
    meant,
    tryOut,
    told,
    why,
    decision,
  );
  const barred = el("p", {
    class: "hint",
    text: "To take contributions out of the map, sign in with a token that has the scope map:edit.",
  });
  const element = el("div", { class: "log-form" }, form, barred, busy, problem, done);
  let drawn = "";

  return {
    element,
    draw(state) {
      const { log } = state;
      const may = mayRevert(state);
      setShown(form, may);
      setShown(barred, !may);
      for (const [input, value] of [[from, log.from], [to, log.to], [reason, log.reason]] as const) {
        if (input.value !== value && input !== document.activeElement) input.value = value;
      }
      const undoes = log.preview?.trial.kind === "undo";
      setShown(span, log.robot !== "" && log.ticked.size === 0 && !undoes);
      const words = targetsInWords(log, (robot) => nameOf(state, robot));
      const [first, last] = [instantOf(log.from), instantOf(log.to)];
      const empty = log.ticked.size === 0 && first !== null && last !== null && first >= last;
      setShown(meant, !undoes);
      setText(
        meant,
        empty
          ? "The span ends before it begins."
          : words === null
            ? "Tick contributions, or choose a robot, to take them out of the map."
            : `Chosen: ${words}.`,
      );
      setShown(tryOut, log.preview === null && targetsOf(log) !== null);
      tryOut.disabled = log.busy !== null || empty;

      const sentences = shownPreview(state);
      const now = sentences.join("\n");
      if (now !== drawn) {
        drawn = now;
        told.replaceChildren(...sentences.map((text) => el("p", { text })));
      }
      setShown(told, sentences.length > 0);
      const moves = (log.preview?.told.moved ?? 0) > 0;
      setShown(decision, log.preview !== null);
      setShown(why, moves && !undoes);
      // A revert that would put nothing back can still be undone: it then covers nothing any more.
      setShown(confirm, moves || undoes);
      setShown(show, log.preview?.told.bounds != null);
      setText(confirm, undoes ? "Put back" : "Take out");
      confirm.disabled = log.busy !== null || (!undoes && log.reason.trim() === "");
      confirm.title = !undoes && log.reason.trim() === "" ? "Give a reason first" : "";
      for (const [line, text] of [[busy, log.busy], [problem, log.problem], [done, log.done]] as const) {
        setShown(line, text !== null);
        setText(line, text ?? "");
      }
    },
  };
}

/** Brings what would change into view. */
function showBounds(state: State, dispatch: LogPanelOptions["store"]["dispatch"]): void {
  const bounds = state.log.preview?.told.bounds;
  const map = document.getElementById("map");
  if (bounds == null || map === null) return;
  const width = (bounds.max_x_m - bounds.min_x_m) / Math.max(1, map.clientWidth);
  const height = (bounds.max_y_m - bounds.min_y_m) / Math.max(1, map.clientHeight);
  dispatch({
    kind: "view",
    view: {
      kind: "at",
      xLevelM: (bounds.min_x_m + bounds.max_x_m) / 2,
      yLevelM: (bounds.min_y_m + bounds.max_y_m) / 2,
      resolution: Math.max(width, height, 0.005) * ROOM,
    },
  });
}
