// All that the page knows, and how each event changes it. Pure: no requests, no drawing, no clock.

import { NO_CONTENT, withRaster, withVector, type Content } from "./content";
import type { Point } from "./geometry";
import type { LayerName, Layers, LayerSetting } from "./layers";
import { withSlots } from "./palette";
import type { Permalink, Place, View } from "./permalink";
import type { Evidence } from "./pyramid";
import { NO_ALIGNMENTS, type AlignmentsState } from "./alignments";
import { NO_CHANGES, type ChangesState } from "./changes";
import { NO_DRAFT, type DraftState } from "./drafts";
import { NO_EDITING, type EditingState } from "./editing";
import { NO_IMPORTS, type ImportsState } from "./imports";
import { NO_FILES, type FilesState } from "./model_files";
import { NO_MODEL, type ModelState, type ModelView } from "./model";
import { NO_LOG, type LogState } from "./reverts";
import type {
  ContributionEntry,
  LastPose,
  LevelDescription,
  RasterChanges,
  RobotDescription,
  RobotFix,
  SessionDescription,
  SiteDescription,
  VectorPatch,
} from "./wire";

/** Whether the operator is signed in. */
export type Session =
  | { kind: "asking" }
  | { kind: "unreachable"; problem: string }
  | { kind: "out"; problem: string | null }
  | { kind: "signing-in" }
  | { kind: "in"; who: SessionDescription };

/** Whether the page follows the level. */
export type Link =
  | { kind: "idle" }
  | { kind: "connecting" }
  | { kind: "live" }
  | { kind: "lost"; sinceMs: number; problem: string };

/** What the operator has chosen on the map. */
export interface Selection {
  kind: "segment" | "cluster" | "chain" | "landmark" | "robot";
  id: string;
}

export interface State {
  session: Session;
  /** Null until they are known. */
  sites: readonly SiteDescription[] | null;
  place: Place | null;
  /** What the link in the address bar asked for and is not there. */
  missing: Place | null;
  /** What is wrong with the chosen level, in words. */
  trouble: string | null;
  level: LevelDescription | null;
  content: Content;
  robots: readonly RobotDescription[];
  /** When the server last had something of a robot, by the server's clock. */
  heardAtMs: ReadonlyMap<string, number>;
  /** Colour slots of robots. */
  slots: ReadonlyMap<string, number>;
  /** The newest ones; null until they are known. */
  contributions: readonly ContributionEntry[] | null;
  log: LogState;
  imports: ImportsState;
  files: FilesState;
  model: ModelState;
  draft: DraftState;
  changes: ChangesState;
  alignments: AlignmentsState;
  editing: EditingState;
  link: Link;
  layers: Layers;
  evidence: Evidence;
  view: View;
  /** Metres per pixel as shown, also while the view fits the level. */
  shownResolution: number;
  pointer: Point | null;
  selection: Selection | null;
  /** Whether the panels are open where they cover the map. */
  panelsOpen: boolean;
  /** The server's time. */
  nowMs: number;
}

export type Event =
  | { kind: "session"; session: Session }
  | { kind: "sites"; sites: readonly SiteDescription[] }
  | { kind: "place"; place: Place | null }
  | { kind: "trouble"; trouble: string | null }
  | { kind: "level"; level: LevelDescription }
  | { kind: "vector"; patch: VectorPatch }
  | { kind: "raster"; changes: RasterChanges }
  | { kind: "robots"; robots: readonly RobotDescription[] }
  | { kind: "contributions"; contributions: readonly ContributionEntry[] }
  | { kind: "log"; log: Partial<LogState> }
  | { kind: "imports"; imports: Partial<ImportsState> }
  | { kind: "files"; files: Partial<FilesState> }
  | { kind: "draft"; draft: Partial<DraftState> }
  | { kind: "changes"; changes: Partial<ChangesState> }
  | { kind: "alignments"; alignments: Partial<AlignmentsState> }
  | { kind: "editing"; editing: Partial<EditingState> }
  | { kind: "model"; model: Partial<ModelState> }
  | { kind: "model-view"; view: Partial<ModelView> }
  | { kind: "heard"; robots: readonly string[]; atMs: number }
  | { kind: "link"; link: Link }
  | { kind: "layer"; name: LayerName; setting: Partial<LayerSetting> }
  | { kind: "evidence"; evidence: Evidence }
  | { kind: "view"; view: View }
  | { kind: "shown"; resolution: number }
  | { kind: "pointer"; at: Point | null }
  | { kind: "select"; selection: Selection | null }
  | { kind: "panels"; open: boolean }
  | { kind: "permalink"; link: Permalink }
  | { kind: "tick"; nowMs: number };

/** What is forgotten with a level. */
const NO_LEVEL = {
  trouble: null,
  level: null,
  content: NO_CONTENT,
  robots: [],
  heardAtMs: new Map<string, number>(),
  slots: new Map<string, number>(),
  contributions: null,
  log: NO_LOG,
  imports: NO_IMPORTS,
  files: NO_FILES,
  draft: NO_DRAFT,
  changes: NO_CHANGES,
  alignments: NO_ALIGNMENTS,
  editing: NO_EDITING,
  link: { kind: "idle" },
  selection: null,
  pointer: null,
} as const;

/** The state of a page just opened at a link. */
export function initialState(link: Permalink, nowMs: number): State {
  return {
    ...NO_LEVEL,
    model: NO_MODEL,
    session: { kind: "asking" },
    sites: null,
    place: link.place,
    missing: null,
    layers: link.layers,
    evidence: link.evidence,
    view: link.view,
    shownResolution: 1,
    panelsOpen: false,
    nowMs,
  };
}

/** The state after an event. */
export function update(state: State, event: Event): State {
  switch (event.kind) {
    case "session":
      return event.session.kind === "out"
        ? { ...state, ...NO_LEVEL, model: NO_MODEL, sites: null, session: event.session }
        : { ...state, session: event.session };
    case "sites":
      return withSites(state, event.sites);
    case "place":
      return samePlace(state.place, event.place)
        ? state
        : { ...state, ...NO_LEVEL, model: { ...NO_MODEL, view: state.model.view }, place: event.place, missing: null, view: { kind: "fit" } };
    case "trouble":
      return { ...state, trouble: event.trouble };
    case "level":
      return { ...state, level: event.level, trouble: null };
    case "vector":
      return forgetSelectionThatIsGone({ ...state, content: withVector(state.content, event.patch) });
    case "raster":
      return { ...state, content: withRaster(state.content, event.changes) };
    case "robots":
      return {
        ...state,
        robots: event.robots.map(atNewestPlace),
        slots: withSlots(state.slots, event.robots.map((robot) => robot.robot)),
      };
    case "contributions":
      return {
        ...state,
        contributions: event.contributions,
        heardAtMs: event.contributions.reduce(
          (heard, entry) => withHeard(heard, [entry.robot], Date.parse(entry.received_at)),
          state.heardAtMs,
        ),
      };
    case "log":
      return { ...state, log: { ...state.log, ...event.log } };
    case "imports":
      return { ...state, imports: { ...state.imports, ...event.imports } };
    case "files":
      return { ...state, files: { ...state.files, ...event.files } };
    case "draft":
      return { ...state, draft: { ...state.draft, ...event.draft } };
    case "changes":
      return { ...state, changes: { ...state.changes, ...event.changes } };
    case "alignments":
      return { ...state, alignments: { ...state.alignments, ...event.alignments } };
    case "editing":
      return { ...state, editing: { ...state.editing, ...event.editing } };
    case "model":
      return forgetSelectionThatIsGone({ ...state, model: { ...state.model, ...event.model } });
    case "model-view":
      return { ...state, model: { ...state.model, view: { ...state.model.view, ...event.view } } };
    case "heard":
      return { ...state, heardAtMs: withHeard(state.heardAtMs, event.robots, event.atMs) };
    case "link":
      return { ...state, link: event.link };
    case "layer":
      return {
        ...state,
        layers: { ...state.layers, [event.name]: { ...state.layers[event.name], ...event.setting } },
      };
    case "evidence":
      return { ...state, evidence: event.evidence };
    case "view":
      return { ...state, view: event.view };
    case "shown":
      return { ...state, shownResolution: event.resolution };
    case "pointer":
      return { ...state, pointer: event.at };
    case "select":
      return { ...state, selection: event.selection };
    case "panels":
      return { ...state, panelsOpen: event.open };
    case "permalink": {
      const at = event.link.place === null ? state : update(state, { kind: "place", place: event.link.place });
      return { ...at, view: event.link.view, layers: event.link.layers, evidence: event.link.evidence };
    }
    case "tick":
      return { ...state, nowMs: event.nowMs };
  }
}

/** Whether whoever is signed in may do what needs this scope. */
export function may({ session }: State, scope: SessionDescription["scopes"][number]): boolean {
  return session.kind === "in" && session.who.scopes.some((held) => held === scope || held === "admin");
}

/** Whether two places are the same. */
export function samePlace(a: Place | null, b: Place | null): boolean {
  return a?.site === b?.site && a?.level === b?.level;
}

/** With the sites known, a place: the one asked for if it is there, else the first level there is. */
function withSites(state: State, sites: readonly SiteDescription[]): State {
  const asked = state.place;
  if (asked !== null && sites.some((site) => site.site === asked.site && site.levels.includes(asked.level))) {
    return { ...state, sites, missing: null };
  }
  const site = sites.find((one) => one.site === asked?.site && one.levels.length > 0) ?? sites.find((one) => one.levels.length > 0);
  const level = site?.levels.at(0);
  const place = site === undefined || level === undefined ? null : { site: site.site, level };
  const chosen = update(state, { kind: "place", place });
  return { ...chosen, sites, missing: asked };
}

function withHeard(
  heard: ReadonlyMap<string, number>,
  robots: readonly string[],
  atMs: number,
): ReadonlyMap<string, number> {
  if (Number.isNaN(atMs)) return heard;
  const later = robots.filter((robot) => (heard.get(robot) ?? -Infinity) < atMs);
  if (later.length === 0) return heard;
  const next = new Map(heard);
  for (const robot of later) next.set(robot, atMs);
  return next;
}

function forgetSelectionThatIsGone(state: State): State {
  const { selection, content, model } = state;
  const gone =
    (selection?.kind === "segment" && !content.segments.has(selection.id)) ||
    (selection?.kind === "cluster" && !content.clusters.has(selection.id)) ||
    (selection?.kind === "chain" && !content.chains.has(selection.id)) ||
    (selection?.kind === "landmark" && !model.landmarks.has(selection.id));
  return gone ? { ...state, selection: null } : state;
}

/** A robot that the server has had nothing of for this long is drawn as silent. */
export const SILENT_AFTER_MS = 60_000;

/** Whether a robot is silent. */
export function isSilent(state: State, robot: string): boolean {
  const heardAtMs = state.heardAtMs.get(robot);
  return heardAtMs === undefined || state.nowMs - heardAtMs > SILENT_AFTER_MS;
}

/** A robot that has been somewhere. */
export type PlacedRobot = RobotDescription & { last_pose: LastPose };

/** Robots whose last pose is on the chosen level. */
export function robotsHere(state: State): PlacedRobot[] {
  return state.robots.filter((robot): robot is PlacedRobot => isHere(state, robot));
}

/** The robot where it is by the newest that is known: it reports its place before it contributes what it saw there. */
function atNewestPlace(robot: RobotDescription): RobotDescription {
  const { fix, last_pose: last } = robot;
  const place = fix?.kind === "unique" || fix?.kind === "tracked" ? fix.places.at(0) : undefined;
  if (fix == null || place === undefined) return robot;
  if (last != null && Date.parse(last.observed_at) >= Date.parse(fix.observed_at)) return robot;
  return { ...robot, last_pose: { ...place, level: fix.level, observed_at: fix.observed_at } };
}

/** What a robot knows of its place on the chosen level, unless it has contributed from another one since. */
export function fixHere(state: State, robot: RobotDescription): RobotFix | null {
  const { fix, last_pose: last } = robot;
  if (fix?.level !== state.place?.level || fix == null) return null;
  const isOld = last != null && Date.parse(last.observed_at) > Date.parse(fix.observed_at);
  return isOld ? null : fix;
}

/** Whether a robot's last pose is on the chosen level. */
export function isHere(state: State, robot: RobotDescription): boolean {
  return robot.last_pose != null && robot.last_pose.level === state.place?.level;
}

/** Edge of a tile in metres, or null while the level is not known. */
export function tileEdgeM(level: LevelDescription | null): number | null {
  return level === null ? null : level.tile_cells * level.resolution_m;
}
