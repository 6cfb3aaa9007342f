// What the prior card asks of the server: what is in a map, making it the prior, taking it away, and
// what was imported so far.

import { inWords, isAborted, type Api } from "./api";
import { NO_IMPORTS, type ImportsState } from "./imports";
import { hasEnded } from "./session";
import { samePlace, type State } from "./state";
import type { Dispatch } from "./store";
import { counted } from "./words";
import { zipped } from "./zip";

/** What the card can be told to do. */
export interface ImportActions {
  open: (open: boolean) => void;
  /** The log has gone on. */
  refresh: () => void;
  /** Other files are chosen, or another trust. */
  choose: (choice: Partial<Pick<ImportsState, "trust">>) => void;
  /** Asks what is in a map. */
  tryOut: (files: readonly File[]) => void;
  /** Makes it the prior. */
  confirm: (files: readonly File[]) => void;
  remove: () => void;
}

export interface ImportActionsOptions {
  api: Api;
  state: () => State;
  dispatch: Dispatch;
}

export function createImportActions({ api, state, dispatch }: ImportActionsOptions): ImportActions {
  let listing = new AbortController();
  let asking = new AbortController();

  const change = (imports: Partial<ImportsState>): void => {
    dispatch({ kind: "imports", imports });
  };
  const failed = (error: unknown): void => {
    if (isAborted(error) || hasEnded(error, dispatch)) return;
    change({ busy: null, problem: inWords(error) });
  };

  const list = async (): Promise<void> => {
    const { place } = state();
    if (place === null) return;
    listing.abort();
    listing = new AbortController();
    const { signal } = listing;
    try {
      const { imports } = await api.imports(place, signal);
      if (!signal.aborted) change({ imports });
    } catch (error) {
      failed(error);
    }
  };

  /** Runs a question of which there is only one at a time, about the level that is shown. */
  const ask = async (busy: string, run: (place: NonNullable<State["place"]>, signal: AbortSignal) => Promise<Partial<ImportsState>>): Promise<void> => {
    const { place } = state();
    if (place === null) return;
    asking.abort();
    const own = new AbortController();
    asking = own;
    change({ busy, problem: null, done: null });
    try {
      const outcome = await run(place, own.signal);
      if (!own.signal.aborted && samePlace(place, state().place)) change({ busy: null, ...outcome });
    } catch (error) {
      if (!own.signal.aborted && samePlace(place, state().place)) failed(error);
    }
  };

  const zipOf = async (files: readonly File[]): Promise<Blob> =>
    zipped(await Promise.all(files.map(async (file) => ({ name: file.name, bytes: new Uint8Array(await file.arrayBuffer()) }))));

  return {
    open: (open) => {
      if (open === state().imports.open) return;
      change({ open });
      if (open) void list();
    },
    refresh: () => {
      if (state().imports.open) void list();
    },
    choose: (choice) => {
      asking.abort();
      change({ told: null, busy: null, problem: null, done: null, ...choice });
    },
    tryOut: (files) =>
      void ask("Reading the map …", async (place, signal) => ({
        told: await api.previewImport(place, await zipOf(files), state().imports.trust, signal),
      })),
    confirm: (files) =>
      void ask("Importing …", async (place) => {
        const made = await api.importPrior(place, await zipOf(files), state().imports.trust);
        void list();
        const tiles = counted(made.report?.tiles ?? 0, "tile");
        return { told: null, done: `It is the prior: ${tiles}, at revision ${made.revision}.` };
      }),
    remove: () =>
      void ask("Taking the prior away …", async (place) => {
        const removed = await api.removePrior(place);
        void list();
        return { told: NO_IMPORTS.told, done: `The prior is gone, at revision ${removed.revision}.` };
      }),
  };
}
