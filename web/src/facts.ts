// What the page shows, as `data-` attributes of the root element, for tests and other observers:
//
//   data-session          asking | unreachable | out | signing-in | in
//   data-site, data-level what is chosen
//   data-live             idle | connecting | live | lost
//   data-revision         the revision that is painted
//   data-segments         segments that are painted (on the screen or beside it)
//   data-pieces-painted   straight pieces of them that are on the screen
//   data-clusters, data-chains, data-robots
//   data-model            height and corners of the plan of the a-priori model; empty without one
//   data-landmarks        landmarks, those of the published model and those that robots taught
//   data-learned          of them, those that robots taught
//   data-tiles            tiles that hold evidence
//   data-tiles-loaded     pictures of the raster that are loaded
//   data-tiles-pending    pictures on the screen that are missing or stale

import { tileCount } from "./content";
import type { Painted } from "./map/view";
import { unsentCount } from "./editing";
import { memo } from "./memo";
import { cornersOf } from "./model";
import { robotsHere, type State } from "./state";
import type { GdbPlan } from "./wire";

export interface Facts {
  /** After the panels were drawn. */
  drawn: (state: State) => void;
  /** After the map was painted. */
  painted: (state: State, painted: Painted) => void;
  /** What the view in space shows. */
  space: (what: string) => void;
}

export function createFacts(root: HTMLElement): Facts {
  const tiles = memo(tileCount);
  const plan = memo((shown: GdbPlan | null) => (shown === null ? "" : `${shown.height_m} ${cornersOf(shown).length}`));
  const unsents = memo(unsentCount);
  const learned = memo((landmarks: State["model"]["landmarks"]) => [...landmarks.values()].filter(({ source }) => source === "learned").length);
  const say = (name: string, value: string | number): void => {
    const text = String(value);
    if (root.dataset[name] !== text) root.dataset[name] = text;
  };
  return {
    drawn({ session, place, link, model, editing }) {
      say("session", session.kind);
      say("site", place?.site ?? "");
      say("level", place?.level ?? "");
      say("live", link.kind);
      say("model", plan(model.plan));
      say("landmarks", model.landmarks.size);
      say("learned", learned(model.landmarks));
      // What is drawn of the draft, and what of it is not sent; empty while nobody edits.
      say("objects", editing.copy?.now.size ?? "");
      say("unsent", editing.copy === null ? "" : unsents(editing));
      say("clashes", editing.clashes.length);
      say("chosen", editing.chosen.size);
    },
    painted(state, { piecesPainted, picturesLoaded, picturesPending }) {
      const { content } = state;
      say("segments", content.segments.size);
      say("piecesPainted", piecesPainted);
      say("clusters", content.clusters.size);
      say("chains", content.chains.size);
      say("robots", robotsHere(state).length);
      say("tiles", tiles(content));
      say("tilesLoaded", picturesLoaded);
      say("tilesPending", picturesPending);
      // Last, for whoever waits for a revision and then reads the rest.
      say("revision", content.vectorRevision);
    },
    space: (what) => {
      say("space", what);
    },
  };
}
