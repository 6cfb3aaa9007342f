// The server's HTTP API, one function per request that the page makes. Every failure is one of two:
// the server refused (with its problem), or it could not be reached.

import type { ModelView } from "./model";
import type { FileTold } from "./model_files";
import type { Place } from "./permalink";
import type { Evidence, PictureAddress } from "./pyramid";
import type {
  Alignment,
  Alignments,
  ContributionPage,
  GdbAnswer,
  GdbCollection,
  GdbEdit,
  GdbEntryPage,
  GdbFindings,
  GdbPlan,
  GdbPreview,
  Import,
  ImportPage,
  ImportReport,
  LandmarkTable,
  LevelDescription,
  ModelChangeAnswer,
  ModelChangeAnswered,
  ModelChanges,
  NewRevert,
  Problem,
  PrototypeCollection,
  RasterChanges,
  Revert,
  RevertPage,
  RevertPreview,
  RobotDescription,
  SessionDescription,
  SiteDescription,
  UncertainPose,
  VectorPatch,
} from "./wire";

/** The server answered and said no. */
export class Refused extends Error {
  override readonly name = "Refused";
  constructor(
    readonly status: number,
    readonly problem: Problem | null,
  ) {
    super(problem?.detail ?? `The server answered with status ${status}.`);
  }
}

/** No answer came, or none that makes sense. */
export class Unreachable extends Error {
  override readonly name = "Unreachable";
}

/** Longest wait for an answer. */
const PATIENCE_MS = 30_000;

/** What the API needs of the browser. */
export interface Browser {
  fetch: typeof fetch;
  nowMs: () => number;
}

export interface Api {
  /** The server's time, as its answers tell it. */
  nowMs: () => number;
  signIn: (token: string) => Promise<SessionDescription>;
  signOut: () => Promise<void>;
  /** Who is signed in; null if nobody is. */
  session: () => Promise<SessionDescription | null>;
  sites: () => Promise<SiteDescription[]>;
  level: (place: Place, signal: AbortSignal) => Promise<LevelDescription>;
  robots: (place: Place, signal: AbortSignal) => Promise<RobotDescription[]>;
  contributions: (
    place: Place,
    options: { limit: number; robot?: string; cursor?: string },
    signal: AbortSignal,
  ) => Promise<ContributionPage>;
  /** The newest reverts. */
  reverts: (place: Place, signal: AbortSignal) => Promise<RevertPage>;
  /** Takes contributions out of the map. */
  revert: (place: Place, revert: NewRevert) => Promise<Revert>;
  /** Puts them back. */
  undoRevert: (place: Place, id: string) => Promise<Revert>;
  /** What either would change. */
  previewRevert: (place: Place, revert: NewRevert, signal: AbortSignal) => Promise<RevertPreview>;
  previewUndo: (place: Place, id: string, signal: AbortSignal) => Promise<RevertPreview>;
  /** The newest imports. */
  imports: (place: Place, signal: AbortSignal) => Promise<ImportPage>;
  /** What is in a map: a zip of a YAML and its image. */
  previewImport: (place: Place, zip: Blob, trust: number, signal: AbortSignal) => Promise<ImportReport>;
  /** Makes it the prior of the level. */
  importPrior: (place: Place, zip: Blob, trust: number) => Promise<Import>;
  /** Takes the prior away. */
  removePrior: (place: Place) => Promise<Import>;
  /** The newest edits and publications of the a-priori model. */
  modelEntries: (place: Place, limit: number, signal: AbortSignal) => Promise<GdbEntryPage>;
  /** The draft: its objects as they are stored. */
  draftModel: (place: Place, signal: AbortSignal) => Promise<GdbCollection>;
  /** The library of the site. */
  prototypes: (place: Place, signal: AbortSignal) => Promise<PrototypeCollection>;
  /** Edits the draft that the operator has seen: that very one, or it is refused. */
  editModel: (place: Place, edit: GdbEdit, made: { draft: number; library: number; comment: string }) => Promise<GdbAnswer>;
  /** What an edit would come to. */
  previewEdit: (place: Place, edit: GdbEdit, signal: AbortSignal) => Promise<GdbPreview>;
  /** What is wrong with the draft. */
  findings: (place: Place, signal: AbortSignal) => Promise<GdbFindings>;
  /** Hands a draft with a library to the robots: that very one, or it is refused. */
  publishModel: (place: Place, version: { draft: number; library: number }) => Promise<GdbAnswer>;
  /** What a sensor at a height would see of it. */
  plan: (place: Place, view: ModelView, signal: AbortSignal) => Promise<GdbPlan>;
  /** Landmarks at a height, those of what is published and those that robots taught; what changed of them after a revision. */
  landmarks: (place: Place, heightM: number, since: number, signal: AbortSignal) => Promise<LandmarkTable>;
  /** Takes a model's file into the draft, or tells what is in it. */
  takeModel: (place: Place, file: { body: Blob; mediaType: string; query: Readonly<Record<string, string>> }, signal: AbortSignal | null) => Promise<FileTold>;
  /** What robots found against what is published, cut at a height. */
  changes: (place: Place, heightM: number) => Promise<ModelChanges>;
  /** What is to become of one of them. */
  answerChange: (place: Place, id: string, answer: ModelChangeAnswer, heightM: number) => Promise<ModelChangeAnswered>;
  /** Frames of robots' own, with the places that they may have, and the alignments in the log. */
  alignments: (place: Place) => Promise<Alignments>;
  /** Accepts where a frame lies. */
  align: (place: Place, frame: string, pose: UncertainPose) => Promise<Alignment>;
  /** Takes a frame off the map again. */
  withdrawAlignment: (place: Place, frame: string) => Promise<Alignment[]>;
  vector: (place: Place, since: number, signal: AbortSignal) => Promise<VectorPatch>;
  raster: (place: Place, since: number, signal: AbortSignal) => Promise<RasterChanges>;
  /** One picture of the raster; null where there is nothing to see. */
  picture: (place: Place, picture: PictureAddress, evidence: Evidence) => Promise<Blob | null>;
}

function levelPath(place: Place): string {
  return `/api/v1/sites/${encodeURIComponent(place.site)}/levels/${encodeURIComponent(place.level)}`;
}

/** Where the live events of a level are. */
export function eventsPath(place: Place): string {
  return `${levelPath(place)}/events`;
}

/** Where a picture of the raster is. */
export function picturePath(place: Place, picture: PictureAddress, evidence: Evidence): string {
  return `${levelPath(place)}/tiles/${picture.z}/${picture.row}/${picture.col}.png?layer=${evidence}`;
}

/** What went wrong, as a sentence for people. */
export function inWords(error: unknown): string {
  if (error instanceof Refused || error instanceof Unreachable) return error.message;
  return error instanceof Error ? `The page failed: ${error.message}` : "The page failed.";
}

/** Whether the work was called off. */
export function isAborted(error: unknown): boolean {
  return error instanceof DOMException && error.name === "AbortError";
}

function posted(body: object): RequestInit {
  return { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body) };
}

function patched(body: object, ifMatch: string): RequestInit {
  return { method: "PATCH", headers: { "content-type": "application/json", "if-match": ifMatch }, body: JSON.stringify(body) };
}

function zip(body: Blob): RequestInit {
  return { method: "POST", headers: { "content-type": "application/zip" }, body };
}

async function problemOf(response: Response): Promise<Problem | null> {
  const type = response.headers.get("content-type") ?? "";
  if (!type.includes("json")) return null;
  const body = (await response.json()) as Partial<Problem>;
  return typeof body.detail === "string" ? (body as Problem) : null;
}

export function createApi(browser: Browser): Api {
  let serverAheadMs = 0;

  const ask = async (path: string, init: RequestInit = {}): Promise<Response> => {
    const patience = AbortSignal.timeout(PATIENCE_MS);
    const signal = init.signal ? AbortSignal.any([init.signal, patience]) : patience;
    let response: Response;
    try {
      response = await browser.fetch(path, { ...init, signal });
    } catch (error) {
      if (isAborted(error)) throw error;
      throw new Unreachable("The server cannot be reached.");
    }
    const date = Date.parse(response.headers.get("date") ?? "");
    // `Date` is cut to the second: half a second is the best guess of what was cut.
    if (!Number.isNaN(date)) serverAheadMs = date + 500 - browser.nowMs();
    if (!response.ok) throw new Refused(response.status, await problemOf(response).catch(() => null));
    return response;
  };

  const askJson = async <T>(path: string, init?: RequestInit): Promise<T> => {
    const headers = new Headers(init?.headers);
    headers.set("accept", "application/json");
    const response = await ask(path, { ...init, headers });
    try {
      return (await response.json()) as T;
    } catch (error) {
      if (isAborted(error)) throw error;
      throw new Unreachable("The server's answer cannot be read.");
    }
  };

  return {
    nowMs: () => browser.nowMs() + serverAheadMs,
    signIn: (token) =>
      askJson("/api/v1/session", posted({ token })),
    signOut: async () => {
      await ask("/api/v1/session", { method: "DELETE" });
    },
    session: async () => {
      try {
        return await askJson<SessionDescription>("/api/v1/session");
      } catch (error) {
        if (error instanceof Refused && error.status === 401) return null;
        throw error;
      }
    },
    sites: () => askJson("/api/v1/sites"),
    level: (place, signal) => askJson(levelPath(place), { signal }),
    robots: (place, signal) => askJson(`/api/v1/sites/${encodeURIComponent(place.site)}/robots`, { signal }),
    contributions: (place, { limit, robot, cursor }, signal) => {
      const filter = robot === undefined ? "" : `&robot=${encodeURIComponent(robot)}`;
      const from = cursor === undefined ? "" : `&cursor=${encodeURIComponent(cursor)}`;
      return askJson(`${levelPath(place)}/contributions?limit=${limit}${filter}${from}`, { signal });
    },
    reverts: (place, signal) => askJson(`${levelPath(place)}/reverts`, { signal }),
    revert: (place, revert) => askJson(`${levelPath(place)}/reverts`, posted(revert)),
    undoRevert: (place, id) => askJson(`${levelPath(place)}/reverts/${encodeURIComponent(id)}`, { method: "DELETE" }),
    previewRevert: (place, revert, signal) =>
      askJson(`${levelPath(place)}/reverts?preview=true`, { ...posted(revert), signal }),
    previewUndo: (place, id, signal) =>
      askJson(`${levelPath(place)}/reverts/${encodeURIComponent(id)}?preview=true`, { method: "DELETE", signal }),
    imports: (place, signal) => askJson(`${levelPath(place)}/imports`, { signal }),
    previewImport: (place, map, trust, signal) =>
      askJson(`${levelPath(place)}/imports?preview=true&trust=${trust}`, { ...zip(map), signal }),
    importPrior: (place, map, trust) => askJson(`${levelPath(place)}/imports?trust=${trust}`, zip(map)),
    removePrior: (place) => askJson(`${levelPath(place)}/imports`, { method: "DELETE" }),
    modelEntries: (place, limit, signal) => askJson(`${levelPath(place)}/gdb/entries?limit=${limit}`, { signal }),
    draftModel: (place, signal) => askJson(`${levelPath(place)}/gdb?state=draft&place=false`, { signal }),
    prototypes: (place, signal) => askJson(`/api/v1/sites/${encodeURIComponent(place.site)}/prototypes`, { signal }),
    editModel: (place, edit, { draft, library, comment }) =>
      askJson(`${levelPath(place)}/gdb?comment=${encodeURIComponent(comment)}`, patched(edit, `"${draft}.${library}"`)),
    previewEdit: (place, edit, signal) => askJson(`${levelPath(place)}/gdb?preview=true`, { ...patched(edit, "*"), signal }),
    findings: (place, signal) => askJson(`${levelPath(place)}/gdb/findings`, { signal }),
    publishModel: (place, { draft, library }) =>
      askJson(`${levelPath(place)}/gdb/publications`, { method: "POST", headers: { "if-match": `"${draft}.${library}"` } }),
    plan: (place, { heightM, state }, signal) =>
      askJson(`${levelPath(place)}/gdb/plan?height_m=${heightM}&state=${state}`, { signal }),
    landmarks: (place, heightM, since, signal) => askJson(`${levelPath(place)}/landmarks?height_m=${heightM}&since=${since}`, { signal }),
    takeModel: (place, { body, mediaType, query }, signal) =>
      askJson(`${levelPath(place)}/imports?${new URLSearchParams(query).toString()}`, { method: "POST", headers: { "content-type": mediaType }, body, signal }),
    changes: (place, heightM) => askJson(`${levelPath(place)}/changes?height_m=${heightM}`),
    answerChange: (place, id, answer, heightM) =>
      askJson(`${levelPath(place)}/changes/${encodeURIComponent(id)}?height_m=${heightM}`, posted({ answer })),
    alignments: (place) => askJson(`${levelPath(place)}/alignments`),
    align: (place, frame, pose) => askJson(`${levelPath(place)}/alignments/${encodeURIComponent(frame)}`, posted({ pose })),
    withdrawAlignment: (place, frame) => askJson(`${levelPath(place)}/alignments/${encodeURIComponent(frame)}`, { method: "DELETE" }),
    vector: (place, since, signal) => askJson(`${levelPath(place)}/vector?since=${since}`, { signal }),
    raster: (place, since, signal) => askJson(`${levelPath(place)}/raster?since=${since}`, { signal }),
    picture: async (place, picture, evidence) => {
      try {
        // "no-cache" asks the server whether the copy at hand is still good; mostly it is.
        const response = await ask(picturePath(place, picture, evidence), { cache: "no-cache" });
        return response.status === 204 ? null : await response.blob();
      } catch (error) {
        if (error instanceof Refused && error.status === 404) return null;
        throw error;
      }
    },
  };
}
