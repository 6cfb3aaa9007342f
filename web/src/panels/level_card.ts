// How much there is on the level.

import { tileCount } from "../content";
import { el, setText } from "../dom";
import { memo } from "../memo";
import type { State } from "../state";
import { count, counted, lengthInWords } from "../words";

export function createLevelCard(parent: HTMLElement): (state: State) => void {
  const title = el("h2");
  const figures = ["Contributions", "Segments", "Clusters", "Chains", "Tiles"].map((name) => {
    const value = el("dd");
    return { value, element: el("div", {}, value, el("dt", { text: name })) };
  });
  const foot = el("p", { class: "hint" });
  parent.append(
    el("section", { class: "card level-card" }, title, el("dl", { class: "figures" }, ...figures.map(({ element }) => element)), foot),
  );
  const tiles = memo(tileCount);

  return (state) => {
    const { level, content } = state;
    setText(title, level === null ? "Level" : level.name);
    const values = [level?.counts.contributions ?? 0, content.segments.size, content.clusters.size, content.chains.size, tiles(content)];
    figures.forEach(({ value }, index) => {
      setText(value, level === null ? "–" : count(values[index] ?? 0));
    });
    const behind = level === null ? 0 : level.revision - Math.max(level.folded_revision, content.vectorRevision);
    const cell = level === null ? "" : `Cells of ${lengthInWords(level.resolution_m)}`;
    const { contributions = 0, in_force = contributions } = level?.counts ?? {};
    const out = contributions - in_force;
    const parts = [
      cell,
      out > 0 ? `${counted(out, "contribution")} kept out of the map` : "",
      behind > 0 ? `${count(behind)} on the way into the map` : "",
    ];
    setText(foot, parts.filter((part) => part !== "").join(" · "));
  };
}
