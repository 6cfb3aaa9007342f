// The reverts of the level, newest first: who, when, why, and the button that undoes one.

import { el, keyed, setShown, setText, type Row } from "../dom";
import { mayRevert, nameOf, type LogActions } from "../reverting";
import { revertInWords } from "../reverts";
import type { State } from "../state";
import type { Revert } from "../wire";
import { count, counted, instant } from "../words";

interface Item {
  revert: Revert;
  state: State;
}

export function createRevertsList(actions: LogActions): { element: HTMLElement; draw: (state: State) => void } {
  const list = el("ul", { class: "reverts", attrs: { "aria-label": "Reverts, newest first" } });
  const summary = el("summary");
  const element = el("details", { class: "log-reverts", attrs: { open: "" } }, summary, list);
  const draw = keyed<Item>(list, {
    key: ({ revert }) => revert.id,
    make: ({ revert }) => createRow(revert, actions),
  });
  return {
    element,
    draw(state) {
      const reverts = state.log.reverts ?? [];
      setShown(element, reverts.length > 0);
      setText(summary, `Taken out so far (${count(reverts.length)})`);
      draw(reverts.map((revert) => ({ revert, state })));
    },
  };
}

function createRow({ id, revision, at, author, reason }: Revert, actions: LogActions): Row<Item> {
  const what = el("span", { class: "what" });
  const how = el("span", { class: "what" });
  const undo = el("button", {
    text: "Undo …",
    attrs: { type: "button", "aria-label": `Undo the revert at revision ${revision}` },
    on: {
      click: () => {
        actions.tryOut({ kind: "undo", revert: id });
      },
    },
  });
  const element = el(
    "li",
    {},
    el("span", { class: "name", text: reason }),
    what,
    el("span", { class: "what", text: `#${count(revision)} · ${instant(at)} · by token ${author}` }),
    how,
    undo,
  );
  return {
    element,
    draw({ revert, state }) {
      setText(what, revertInWords(revert, (robot) => nameOf(state, robot)));
      const { undone } = revert;
      setShown(how, undone != null);
      setText(
        how,
        undone == null
          ? ""
          : `Undone: ${counted(undone.put_back, "contribution")} put back · #${count(undone.revision)} · ${instant(undone.at)} · by token ${undone.author}`,
      );
      element.classList.toggle("undone", undone != null);
      setShown(undo, undone == null && mayRevert(state));
      undo.disabled = state.log.busy !== null;
    },
  };
}
