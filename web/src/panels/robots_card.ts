// The fleet, and the legend of the map's colours. A click on a robot shows where it is.

import { competenceInWords } from "../competence";
import { el, keyed, setShown, setText, swatch, type Row } from "../dom";
import { strokeOf, strokeOfSeveral, type Theme } from "../palette";
import { fixHere, isHere, isSilent, type State } from "../state";
import type { Store } from "../store";
import { ago, count, counted } from "../words";
import type { RobotDescription } from "../wire";

interface Item {
  robot: RobotDescription;
  state: State;
}

export function createRobotsCard(
  parent: HTMLElement,
  options: { store: Store; theme: () => Theme },
): (state: State) => void {
  const list = el("ul", { class: "robots" });
  const severalSwatch = swatch();
  const several = el("p", { class: "several" }, severalSwatch.element, "seen by several robots");
  const none = el("p", { class: "hint", text: "No robot is enrolled on this site." });
  parent.append(el("section", { class: "card" }, el("h2", { text: "Robots" }), list, several, none));
  const drawRows = keyed<Item>(list, {
    key: ({ robot }) => robot.robot,
    make: ({ robot }) => createRow(robot.robot, options),
  });

  return (state) => {
    const here = state.robots.filter((robot) => isHere(state, robot));
    const elsewhere = state.robots.filter((robot) => !isHere(state, robot));
    drawRows([...here, ...elsewhere].map((robot) => ({ robot, state })));
    severalSwatch.draw(strokeOfSeveral(options.theme()));
    setShown(several, state.robots.length > 1);
    setShown(none, state.level !== null && state.robots.length === 0);
  };
}

function createRow(slug: string, { store, theme }: { store: Store; theme: () => Theme }): Row<Item> {
  const line = swatch();
  const name = el("span", { class: "name" });
  const what = el("span", { class: "what" });
  const when = el("span", { class: "when" });
  const button = el(
    "button",
    {
      attrs: { type: "button" },
      on: {
        click: () => {
          goTo(store, slug);
        },
      },
    },
    line.element,
    name,
    when,
    what,
  );
  return {
    element: el("li", {}, button),
    draw({ robot, state }) {
      line.draw(strokeOf(theme(), state.slots.get(slug) ?? 0));
      setText(name, robot.name);
      const { contributions, reverted = 0 } = robot;
      const out = reverted > 0 ? `, ${count(reverted)} taken out` : "";
      setText(what, `${competenceInWords(robot)} · ${counted(contributions, "contribution")}${out}`);
      const silent = isSilent(state, slug);
      button.classList.toggle("silent", silent);
      setText(when, whenInWords(state, robot, silent));
      button.disabled = !isHere(state, robot);
    },
  };
}

function whenInWords(state: State, robot: RobotDescription, silent: boolean): string {
  if (robot.state === "held") return "held";
  if (robot.last_pose != null && !isHere(state, robot)) return `on level ${robot.last_pose.level}`;
  const fix = fixHere(state, robot);
  if (fix?.kind === "ambiguous") return "not sure where it is";
  if (fix?.kind === "no_match") return "lost";
  const heardAtMs = state.heardAtMs.get(robot.robot);
  if (heardAtMs === undefined) return robot.contributions === 0 ? "not heard yet" : "offline";
  return silent ? `offline · ${ago(heardAtMs, state.nowMs)}` : ago(heardAtMs, state.nowMs);
}

/** Chooses a robot and brings it into the middle of the map. */
function goTo(store: Store, slug: string): void {
  const state = store.state();
  const pose = state.robots.find((robot) => robot.robot === slug)?.last_pose;
  if (pose == null) return;
  store.dispatch({ kind: "select", selection: { kind: "robot", id: slug } });
  store.dispatch({
    kind: "view",
    view: { kind: "at", xLevelM: pose.x_m, yLevelM: pose.y_m, resolution: Math.min(state.shownResolution, 0.05) },
  });
}
