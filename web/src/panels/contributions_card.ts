// The newest lines of the log: who, when, how much. A click shows from where.

import { el, keyed, setShown, setText, swatch, type Row } from "../dom";
import { strokeOf, type Theme } from "../palette";
import type { State } from "../state";
import type { Store } from "../store";
import type { ContributionEntry } from "../wire";
import { ago, count, counted, instant } from "../words";

interface Item {
  entry: ContributionEntry;
  state: State;
}

export function createContributionsCard(
  parent: HTMLElement,
  options: { store: Store; theme: () => Theme; onOpenLog: () => void },
): (state: State) => void {
  const all = el("button", {
    text: "Log …",
    attrs: { type: "button", id: "open-log", title: "All contributions of this level; take some out of the map", "aria-controls": "log" },
    on: { click: options.onOpenLog },
  });
  const list = el("ul", { class: "contributions" });
  const none = el("p", { class: "hint", text: "None yet." });
  parent.append(el("section", { class: "card" }, el("div", { class: "card-head" }, el("h2", { text: "Latest contributions" }), all), list, none));
  const drawRows = keyed<Item>(list, {
    key: ({ entry }) => entry.id,
    make: ({ entry }) => createRow(entry, options),
  });
  return (state) => {
    const entries = state.contributions ?? [];
    drawRows(entries.map((entry) => ({ entry, state })));
    all.setAttribute("aria-expanded", String(state.log.open));
    setShown(none, state.contributions !== null && entries.length === 0);
  };
}

/** What a contribution holds, in words. */
export function howMuch(entry: ContributionEntry): string {
  const parts = [
    entry.segments > 0 ? counted(entry.segments, "segment") : "",
    entry.clusters > 0 ? counted(entry.clusters, "cluster") : "",
    entry.tiles > 0 ? counted(entry.tiles, "tile") : "",
  ].filter((part) => part !== "");
  return parts.length === 0 ? "only its pose" : parts.join(", ");
}

function createRow(entry: ContributionEntry, { store, theme }: { store: Store; theme: () => Theme }): Row<Item> {
  const line = swatch();
  const who = el("span", { class: "name" });
  const place = el("span", { class: "when" });
  const when = el("span", { class: "when" });
  const what = el("span", { class: "what" });
  const [x, y] = entry.pose;
  const button = el(
    "button",
    {
      attrs: {
        type: "button",
        title: `Revision ${entry.revision} · received ${instant(entry.received_at)} · seen ${instant(entry.observed_at)} by the robot's clock`,
      },
      on: {
        click: () => {
          const resolution = Math.min(store.state().shownResolution, 0.05);
          store.dispatch({ kind: "view", view: { kind: "at", xLevelM: x, yLevelM: y, resolution } });
        },
      },
    },
    line.element,
    el("span", { class: "who-and-where" }, who, place),
    when,
    what,
  );
  return {
    element: el("li", {}, button),
    draw({ entry: now, state }) {
      line.draw(strokeOf(theme(), state.slots.get(now.robot) ?? 0));
      const name = state.robots.find((robot) => robot.robot === now.robot)?.name ?? now.robot;
      setText(who, now.state === "folded" ? name : `${name} · ${now.state === "held" ? "held" : "taken out"}`);
      setText(place, `#${count(now.revision)}`);
      setText(when, ago(Date.parse(now.received_at), state.nowMs));
      setText(what, `${howMuch(now)}${now.emulated ? " · emulated" : ""}`);
      button.classList.toggle("out", now.state !== "folded");
    },
  };
}
