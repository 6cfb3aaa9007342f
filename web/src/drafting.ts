// What the model card asks of the server: the log of the model, what is wrong with its draft, and to publish it.

import { inWords, isAborted, type Api } from "./api";
import type { DraftState } from "./drafts";
import type { Place } from "./permalink";
import { hasEnded } from "./session";
import { may, samePlace, type State } from "./state";
import type { Dispatch } from "./store";

/** Entries that the card shows. */
const LINES = 10;

/** What the card can be told to do. */
export interface DraftActions {
  open: (open: boolean) => void;
  /** The log has gone on. */
  refresh: () => void;
  publish: () => void;
}

export interface DraftActionsOptions {
  api: Api;
  state: () => State;
  dispatch: Dispatch;
}

export function createDraftActions({ api, state, dispatch }: DraftActionsOptions): DraftActions {
  let reading = new AbortController();

  const change = (draft: Partial<DraftState>): void => {
    dispatch({ kind: "draft", draft });
  };
  const failed = (place: Place, error: unknown): void => {
    if (isAborted(error) || !samePlace(place, state().place) || hasEnded(error, dispatch)) return;
    change({ busy: null, problem: inWords(error) });
  };

  const read = async (): Promise<void> => {
    const { place } = state();
    if (place === null) return;
    reading.abort();
    reading = new AbortController();
    const { signal } = reading;
    try {
      const [{ entries }, { draft, library, findings: list }] = await Promise.all([
        api.modelEntries(place, LINES, signal),
        api.findings(place, signal),
      ]);
      if (!signal.aborted && samePlace(place, state().place)) change({ entries, findings: { draft, library, list } });
    } catch (error) {
      failed(place, error);
    }
  };

  const publish = async (): Promise<void> => {
    const { place } = state();
    const { findings, busy } = state().draft;
    if (place === null || findings === null || busy !== null) return;
    change({ busy: "Publishing …", problem: null, done: null });
    try {
      // What the operator has read, and nothing that came after.
      const { entry } = await api.publishModel(place, findings);
      if (!samePlace(place, state().place)) return;
      change({ busy: null, done: entry == null ? "Robots have it already." : `Published, at revision ${entry.revision}.` });
    } catch (error) {
      failed(place, error);
    }
    void read();
  };

  return {
    open: (open) => {
      if (open === state().draft.open) return;
      change({ open, problem: null, done: null });
      if (open) void read();
    },
    refresh: () => {
      if (state().draft.open) void read();
    },
    publish: () => void publish(),
  };
}

/** Whether the operator may publish. */
export function mayPublish(state: State): boolean {
  return may(state, "map:publish");
}
