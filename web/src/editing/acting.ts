// What editing asks of the server and of the browser's memory: the draft, what would be wrong with it, sending edits,
// and going on from a newer draft. Edits that are refused stay with the operator.

import { inWords, isAborted, Refused, type Api } from "../api";
import type { Timers } from "../coalesce";
import { edited, newsInWords, NO_EDITING, type EditingState } from "../editing";
import type { Place } from "../permalink";
import { hasEnded } from "../session";
import { may, samePlace, type State } from "../state";
import type { Dispatch } from "../store";
import type { GdbCollection, GdbEdit, GdbObject, Problem, PrototypeCollection } from "../wire";
import { counted } from "../words";
import { stillThere } from "./choosing";
import { unsent, withSent, workingCopy, type Puts, type Version } from "./history";
import { kept, keyOf, restored, together } from "./keeping";
import { nameOf, type Library, type Objects } from "./objects";
import { finished } from "./pointing";
import { rebased, type Clash, type Rebased } from "./rebasing";

/** Entries of the log that are read to say what others did. */
const ENTRIES = 50;
/** What is wrong is asked for once nothing has changed for so long. */
const QUIET_MS = 400;
/** The scope that editing takes. */
const SCOPE = "map:edit";

/** What the browser remembers; a subset of `Storage`. */
export type Memory = Pick<Storage, "getItem" | "setItem" | "removeItem">;

export interface EditActions {
  /** Opens the draft for editing, with what was kept of earlier edits. */
  start: () => void;
  /** Closes it; what is not sent is kept. */
  stop: () => void;
  /** Shows the draft in space, or no longer. */
  turnSpace: () => void;
  /** A level is shown: goes on with edits that were kept. */
  arrived: () => void;
  /** The model's log has gone on. */
  refresh: () => void;
  /** The working copy has changed: keeps it, and asks what would be wrong with it. */
  changed: () => void;
  send: () => void;
  /** Gives up all that is not sent. */
  discard: () => void;
  /** Puts the operator's version in the place of what others made. */
  takeMine: (id: string) => void;
  /** Gives the operator's version up. */
  dropMine: (id: string) => void;
  change: (editing: Partial<EditingState>) => void;
}

export interface EditActionsOptions {
  api: Api;
  state: () => State;
  dispatch: Dispatch;
  memory: Memory;
  timers: Timers;
  uuid: () => string;
}

export function createEditActions({ api, state, dispatch, memory, timers, uuid }: EditActionsOptions): EditActions {
  let reading = new AbortController();
  let checking = new AbortController();
  let quiet: number | null = null;

  const change = (editing: Partial<EditingState>): void => {
    dispatch({ kind: "editing", editing });
  };
  const isHere = (place: Place): boolean => samePlace(place, state().place) && (state().editing.on || state().editing.is3d);
  const failed = (place: Place, error: unknown): void => {
    if (isAborted(error) || hasEnded(error, dispatch) || !isHere(place)) return;
    change({ busy: null, problem: inWords(error) });
  };

  /** Takes over a draft: the first one, or a newer one with the operator's edits on it. */
  const read = async (place: Place): Promise<void> => {
    reading.abort();
    reading = new AbortController();
    const { signal } = reading;
    const [collection, prototypes, { entries }] = await Promise.all([
      api.draftModel(place, signal),
      api.prototypes(place, signal),
      api.modelEntries(place, ENTRIES, signal),
    ]);
    if (signal.aborted || !isHere(place)) return;
    const [objects, version] = draftOf(collection);
    const { copy, clashes, chosen, sketch, on } = state().editing;
    const text = copy === null && on ? memory.getItem(keyOf(place)) : null;
    const next: Rebased =
      copy !== null
        ? rebased(copy, objects, version)
        : ((text === null ? null : restored(text, objects, version)) ?? { copy: workingCopy(objects, version), clashes: [], news: { added: 0, changed: 0, removed: 0 } });
    const since = copy?.version.draft ?? (text === null ? version.draft : (seenIn(text) ?? version.draft));
    const others = entries.filter(({ kind, revision }) => kind === "edit" && revision > since);
    const told = newsInWords(next.news, others);
    change({
      copy: next.copy,
      library: libraryOf(prototypes),
      clashes: together(clashes, next.clashes, objects),
      chosen: stillThere(chosen, next.copy.now),
      findings: null,
      ...(sketch.kind === "walls" ? {} : { sketch: NO_EDITING.sketch }),
      ...(told.length === 0 ? {} : { news: told }),
    });
  };

  const check = async (): Promise<void> => {
    const { place, editing } = state();
    if (place === null || editing.copy === null || !editing.on) return;
    checking.abort();
    checking = new AbortController();
    const { signal } = checking;
    try {
      const { findings } = await api.previewEdit(place, editOf(unsent(editing.copy)), signal);
      if (!signal.aborted && state().editing.copy === editing.copy) change({ findings });
    } catch (error) {
      // Sending says what is wrong with what cannot even be read.
      if (error instanceof Refused && error.status === 422) return;
      failed(place, error);
    }
  };

  const keep = (): void => {
    const { place, editing } = state();
    if (place === null || editing.copy === null || !editing.on) return;
    const text = kept(editing.copy, editing.clashes);
    let isKept = true;
    try {
      if (text === null) memory.removeItem(keyOf(place));
      else memory.setItem(keyOf(place), text);
    } catch {
      isKept = false;
    }
    if (isKept !== editing.isKept) change({ isKept });
  };

  const open = async (place: Place, on: boolean): Promise<void> => {
    const { making, is3d } = state().editing;
    change({ ...NO_EDITING, making, on, is3d: is3d || !on, busy: "Asking for the draft …" });
    try {
      await read(place);
      if (isHere(place)) change({ busy: null });
    } catch (error) {
      failed(place, error);
    }
  };

  const send = async (place: Place): Promise<void> => {
    const { copy, comment, busy } = state().editing;
    if (copy === null || busy !== null) return;
    const puts = unsent(copy);
    if (puts.size === 0) return;
    change({ busy: "Sending …", problem: null, done: null });
    try {
      const { draft, library, entry } = await api.editModel(place, editOf(puts), { ...copy.version, comment: comment.trim() });
      const now = state().editing.copy;
      if (!isHere(place) || now === null) return;
      const said = entry == null ? "The draft is so already." : `In the draft: ${counted(puts.size, "object")}, at revision ${entry.revision}.`;
      change({ copy: withSent(now, puts, { draft, library }), busy: null, comment: "", done: said, news: [] });
    } catch (error) {
      if (error instanceof Refused && error.status === 412 && isHere(place)) await overtaken(place, error.problem, puts);
      else if (error instanceof Refused && error.status === 422 && isHere(place)) change({ busy: null, problem: faults(error, puts) });
      else failed(place, error);
    }
  };

  /** Others were faster: nothing was taken, and nothing is lost. */
  const overtaken = async (place: Place, problem: Problem | null, puts: Puts): Promise<void> => {
    const { copy } = state().editing;
    const named = (problem?.errors ?? []).filter(({ pointer }) => pointer !== "").map(({ detail }) => withNames(detail, copy?.now ?? new Map(), puts));
    try {
      await read(place);
      const { clashes } = state().editing;
      const rest = clashes.length === 0 ? "They fit the new draft: look at it, and send them again." : "Those that no longer fit are listed below; the others fit the new draft.";
      change({ busy: null, problem: ["Your edits were not sent, as others have changed the draft meanwhile. None is lost.", rest, ...named.map((line) => `${line}.`)].join(" ") });
    } catch (error) {
      failed(place, error);
    }
  };

  const decide = (id: string, isMine: boolean): void => {
    const { editing } = state();
    const clash = editing.clashes.find((one) => one.id === id);
    if (clash === undefined) return;
    const clashes = editing.clashes.filter((one) => one !== clash);
    const puts: Puts = new Map(isMine ? [[id, clash.mine]] : []);
    change({ ...edited(editing, `your version of ${nameOf(clash.mine ?? clash.theirs)}`, puts), clashes });
  };

  const start = (): void => {
    const { place, editing } = state();
    if (place !== null && !editing.on && mayEdit(state())) void open(place, true);
  };

  return {
    start,
    stop: () => {
      // Walls that are being drawn end where they have come to.
      change(finished(state().editing, { uuid }));
      keep();
      checking.abort();
      const { place, editing } = state();
      if (editing.is3d && place !== null) {
        void open(place, false);
        return;
      }
      reading.abort();
      change({ ...NO_EDITING, making: editing.making });
    },
    turnSpace: () => {
      const { place, editing } = state();
      if (place === null) return;
      if (!editing.is3d && editing.copy === null && !editing.on) void open(place, false);
      else if (editing.on || !editing.is3d) change({ ...finished(editing, { uuid }), tool: "select", is3d: !editing.is3d });
      else {
        reading.abort();
        change({ ...NO_EDITING, making: editing.making });
      }
    },
    arrived: () => {
      const { place } = state();
      if (place !== null && memory.getItem(keyOf(place)) !== null) start();
    },
    refresh: () => {
      const { place, editing, model } = state();
      if (place === null || editing.copy === null || editing.busy !== null || model.revision === null) return;
      if (model.revision > editing.copy.version.draft) {
        void (async () => {
          try {
            const [newest] = (await api.modelEntries(place, 1, reading.signal)).entries;
            const version = state().editing.copy?.version;
            if (newest === undefined || version === undefined || state().editing.busy !== null) return;
            if (newest.draft !== version.draft) await read(place);
          } catch (error) {
            failed(place, error);
          }
        })();
      }
    },
    changed: () => {
      // Who only looks has nothing to keep.
      if (!state().editing.on) return;
      keep();
      if (quiet !== null) timers.clearTimeout(quiet);
      checking.abort();
      quiet = timers.setTimeout(() => {
        quiet = null;
        void check();
      }, QUIET_MS);
    },
    send: () => {
      const { place } = state();
      if (place !== null) void send(place);
    },
    discard: () => {
      const { copy } = state().editing;
      if (copy === null) return;
      change({ copy: workingCopy(copy.base, copy.version), clashes: [], chosen: new Set(), sketch: NO_EDITING.sketch, findings: null, problem: null, news: [], done: "Your unsent edits are gone." });
    },
    takeMine: (id) => {
      decide(id, true);
    },
    dropMine: (id) => {
      decide(id, false);
    },
    change,
  };
}

/** Whether the operator may edit the model. */
export function mayEdit(state: State): boolean {
  return may(state, SCOPE);
}

function draftOf({ features, revision, library }: GdbCollection): [Objects, Version] {
  const objects = new Map(features.map(({ id, properties }): [string, GdbObject] => [id, properties]));
  return [objects, { draft: revision ?? 0, library: library ?? 0 }];
}

function libraryOf({ features }: PrototypeCollection): Library {
  return new Map(features.map(({ id, properties }) => [id, properties]));
}

function seenIn(text: string): number | null {
  const value = JSON.parse(text) as { version?: Version };
  return value.version?.draft ?? null;
}

/** What is sent. */
export function editOf(puts: Puts): GdbEdit {
  const edit: GdbEdit = { put: [], remove: [] };
  for (const [id, properties] of puts) {
    if (properties === null) edit.remove.push(id);
    else edit.put.push({ type: "Feature", id, properties });
  }
  return edit;
}

/** Names of objects in the place of their identities. */
function withNames(detail: string, objects: Objects, puts: Puts): string {
  return detail.replace(/\bobject ([0-9a-f-]{36})/g, (whole, id: string) => {
    const object = objects.get(id) ?? puts.get(id);
    return object == null ? whole : nameOf(object);
  });
}

/** What the server could not take, with what it is about. */
function faults(error: Refused, puts: Puts): string {
  const { put } = editOf(puts);
  const lines = (error.problem?.errors ?? []).map(({ pointer, detail }) => {
    const index = /^\/put\/(\d+)/.exec(pointer)?.[1];
    const feature = index === undefined ? undefined : put[Number(index)];
    return feature === undefined ? detail : `${nameOf(feature.properties)}: ${detail}`;
  });
  return ["Your edits were not taken, and none is lost.", ...(lines.length === 0 ? [error.message] : lines)].join(" ");
}

/** A clash that is still open about an object. */
export function clashOf({ clashes }: EditingState, id: string): Clash | null {
  return clashes.find((clash) => clash.id === id) ?? null;
}
