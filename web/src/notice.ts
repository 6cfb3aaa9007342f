// What the page says when there is no map to show, or something is wrong: in words, with what to do.

import type { State } from "./state";
import { ago } from "./words";

/** A message in the middle of the map, in place of it. */
export interface Notice {
  title: string;
  text: string;
  /** A command that helps. */
  command?: string;
}

/** What to say instead of a map; null if there is one. */
export function noticeOf(state: State, origin: string): Notice | null {
  if (state.session.kind !== "in") return null;
  if (state.sites === null) return { title: "Loading", text: "Asking the server for its sites." };
  if (state.place === null) {
    return {
      title: state.sites.length === 0 ? "No site yet" : "No level yet",
      text:
        "A map appears as soon as a robot brings one. To try it with a robot's log, run this with an admin token; " +
        "it makes the site, the level and the robot. Then load this page again.",
      command: replayCommand(origin, { site: state.sites.at(0)?.site ?? "plant", level: "ground" }),
    };
  }
  if (state.trouble !== null) return { title: "This level cannot be shown", text: state.trouble };
  if (state.level === null) {
    return state.link.kind === "lost" ? null : { title: "Loading", text: "Asking the server for the map." };
  }
  // Who draws the building needs the ground, empty as it is.
  if (state.editing.on) return null;
  const { segments, clusters, tiles, vectorRevision } = state.content;
  if (state.level.revision === 0 && segments.size + clusters.size + tiles.size + vectorRevision === 0) {
    return {
      title: "Nothing here yet",
      text: "No robot has contributed to this level. The map draws itself here as soon as one does.",
      command: replayCommand(origin, state.place),
    };
  }
  return null;
}

function replayCommand(origin: string, place: { site: string; level: string }): string {
  return (
    `mapfold-robot replay LOG --server ${origin} --token TOKEN \\\n` +
    `    --site ${place.site} --level ${place.level} --robot NAME --create`
  );
}

/** A line above the map while the map itself can be seen; null if all is well. */
export function warningOf(state: State): string | null {
  if (state.session.kind !== "in") return null;
  if (state.link.kind === "lost") {
    const shown = state.level === null ? "" : ` The map is as it was ${ago(state.link.sinceMs, state.nowMs)}.`;
    return `${state.link.problem}${shown} Trying again …`;
  }
  if (state.missing !== null && state.place !== null) {
    const { site, level } = state.missing;
    return `The link leads to level “${level}” of site “${site}”, which is not there, or not for you. This is another one.`;
  }
  return null;
}
