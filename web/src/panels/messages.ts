// The message in the middle of an empty map, and the warning above a map that is not what it seems.

import { el, setShown, setText } from "../dom";
import { noticeOf, warningOf } from "../notice";
import type { State } from "../state";

export function createMessages(parent: HTMLElement, origin: string): (state: State) => void {
  const title = el("h2");
  const text = el("p");
  const command = el("pre", { attrs: { tabindex: "0" } });
  const notice = el("section", { class: "card notice", attrs: { role: "status" } }, title, text, command);
  const warning = el("p", { class: "warning", attrs: { role: "status" } });
  parent.append(notice, warning);

  return (state) => {
    const say = noticeOf(state, origin);
    setShown(notice, say !== null);
    setText(title, say?.title ?? "");
    setText(text, say?.text ?? "");
    setShown(command, say?.command !== undefined);
    setText(command, say?.command ?? "");
    const warn = warningOf(state);
    setShown(warning, warn !== null);
    setText(warning, warn ?? "");
  };
}
