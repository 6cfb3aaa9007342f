// The log of the level, beside the map: who contributed what and when, and for those who may, taking
// contributions out of the map and putting them back.

import { el, keyed, setShown, setText, swatch, type Row } from "../dom";
import { strokeOf, type Theme } from "../palette";
import { mayRevert, nameOf, type LogActions } from "../reverting";
import { isMeant } from "../reverts";
import type { State } from "../state";
import type { Store } from "../store";
import type { ContributionEntry } from "../wire";
import { count, counted, instant } from "../words";
import { howMuch } from "./contributions_card";
import { createRevertForm } from "./revert_form";
import { createRevertsList } from "./reverts_list";

interface Item {
  entry: ContributionEntry;
  state: State;
}

export interface LogPanelOptions {
  parent: HTMLElement;
  store: Store;
  theme: () => Theme;
  actions: LogActions;
}

export function createLogPanel(options: LogPanelOptions): (state: State) => void {
  const { parent, actions } = options;
  const robot = el("select", {
    attrs: { id: "log-robot" },
    on: {
      change: () => {
        actions.choose({ robot: robot.value });
      },
    },
  });
  const close = el("button", {
    class: "close",
    text: "×",
    attrs: { type: "button", "aria-label": "Close the log", title: "Close (Esc)" },
    on: { click: actions.close },
  });
  const list = el("ul", { class: "log-lines", attrs: { "aria-label": "Contributions, newest first" } });
  const more = el("button", { class: "more", text: "Show more", attrs: { type: "button" }, on: { click: actions.more } });
  const hint = el("p", { class: "hint" });
  const form = createRevertForm(options);
  const reverts = createRevertsList(actions);
  const panel = el(
    "section",
    { class: "card log", attrs: { id: "log", "aria-label": "Log" } },
    el("h2", { text: "Log" }),
    close,
    el("div", { class: "log-filter" }, el("label", { text: "Robot", attrs: { for: "log-robot" } }), robot),
    form.element,
    reverts.element,
    el("div", { class: "log-scroll" }, list, hint, more),
  );
  parent.append(panel);
  const drawLines = keyed<Item>(list, {
    key: ({ entry }) => entry.id,
    make: ({ entry }) => createLine(entry, options),
  });
  let wasOpen = false;
  let opener: Element | null = null;

  return (state) => {
    const { log } = state;
    setShown(panel, log.open);
    if (log.open !== wasOpen) {
      wasOpen = log.open;
      if (log.open) {
        opener = document.activeElement;
        robot.focus();
      } else if (opener instanceof HTMLElement) opener.focus();
    }
    if (!log.open) return;
    drawRobots(robot, state);
    drawLines((log.entries ?? []).map((entry) => ({ entry, state })));
    setShown(more, log.next !== null);
    setShown(hint, log.entries === null || log.entries.length === 0);
    setText(hint, log.entries === null ? "Asking for the log …" : "No contributions.");
    form.draw(state);
    reverts.draw(state);
  };
}

function drawRobots(select: HTMLSelectElement, state: State): void {
  const choices = state.robots.map(({ robot, name, contributions, reverted }) => {
    const out = reverted !== undefined && reverted > 0 ? `, ${count(reverted)} out` : "";
    return { value: robot, title: `${name} (${counted(contributions, "contribution")}${out})` };
  });
  const wanted = JSON.stringify(choices);
  if (select.dataset["choices"] !== wanted) {
    select.dataset["choices"] = wanted;
    select.replaceChildren(
      el("option", { text: "All robots", attrs: { value: "" } }),
      ...choices.map(({ value, title }) => el("option", { text: title, attrs: { value } })),
    );
  }
  if (select.value !== state.log.robot) select.value = state.log.robot;
}

const STATE_WORDS = { folded: "", held: "held · ", reverted: "taken out · " } as const;

function createLine(entry: ContributionEntry, { store, theme, actions }: LogPanelOptions): Row<Item> {
  const line = swatch();
  const tick = el("input", {
    attrs: { type: "checkbox", "aria-label": `Contribution ${entry.revision}` },
    on: {
      change: () => {
        actions.tick(entry.id, tick.checked);
      },
    },
  });
  const who = el("span", { class: "name" });
  const state = el("span", { class: "state" });
  const [x, y] = entry.pose;
  const show = el(
    "button",
    {
      attrs: { type: "button", title: `Show from where. Received ${instant(entry.received_at)}` },
      on: {
        click: () => {
          const resolution = Math.min(store.state().shownResolution, 0.05);
          store.dispatch({ kind: "view", view: { kind: "at", xLevelM: x, yLevelM: y, resolution } });
        },
      },
    },
    el("span", { class: "who-and-where" }, who, el("span", { class: "when", text: `#${count(entry.revision)}` })),
    el("span", { class: "when", text: instant(entry.observed_at) }),
    el("span", { class: "what" }, state, `${howMuch(entry)}${entry.emulated ? " · emulated" : ""}`),
  );
  const element = el("li", {}, tick, line.element, show);
  return {
    element,
    draw({ entry: now, state: known }) {
      line.draw(strokeOf(theme(), known.slots.get(now.robot) ?? 0));
      setText(who, nameOf(known, now.robot));
      setText(state, STATE_WORDS[now.state]);
      setShown(tick, mayRevert(known));
      tick.disabled = now.state !== "folded";
      tick.checked = known.log.ticked.has(now.id);
      element.classList.toggle("out", now.state !== "folded");
      element.classList.toggle("meant", mayRevert(known) && now.state === "folded" && isMeant(known.log, now));
    },
  };
}
