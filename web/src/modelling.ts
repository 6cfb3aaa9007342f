// Follows the a-priori model: after the level has changed, asks whether its model has, and only then for
// the plan. Landmarks follow the map too, for robots teach some.

import { inWords, isAborted, Refused, type Api } from "./api";
import { createCoalescer, type Timers } from "./coalesce";
import { isRead, withTable, type ModelState } from "./model";
import type { Place } from "./permalink";
import { samePlace, type State } from "./state";
import type { Dispatch } from "./store";

/** Least time between two looks at the log of the model. */
const INTERVAL_MS = 2_000;

export interface ModelFollower {
  /** The level has changed, or what is asked for. */
  look: () => void;
  stop: () => void;
}

export interface ModelFollowerOptions {
  place: Place;
  api: Api;
  state: () => State;
  dispatch: Dispatch;
  timers: Timers;
}

export function followModel({ place, api, state, dispatch, timers }: ModelFollowerOptions): ModelFollower {
  const abort = new AbortController();
  const { signal } = abort;
  const tell = (model: Partial<ModelState>): void => {
    if (!signal.aborted && samePlace(place, state().place)) dispatch({ kind: "model", model });
  };

  const followLandmarks = async (): Promise<void> => {
    const { model, layers, level } = state();
    const { told, view, landmarks } = model;
    if (!layers.landmarks.on || told === null || (level?.revision ?? 0) <= told) return;
    try {
      tell(withTable(landmarks, await api.landmarks(place, view.heightM, told, signal)));
    } catch (error) {
      // The server does not know any more what it told: all of it, then.
      if (!(error instanceof Refused && error.status === 410)) throw error;
      tell(withTable(new Map(), await api.landmarks(place, view.heightM, 0, signal)));
    }
  };

  const looking = createCoalescer({
    intervalMs: INTERVAL_MS,
    timers,
    run: async () => {
      try {
        const newest = (await api.modelEntries(place, 1, signal)).entries.at(0)?.revision ?? 0;
        const { view } = state().model;
        if (isRead(state().model, newest)) {
          await followLandmarks();
          return;
        }
        const table = await api.landmarks(place, view.heightM, 0, signal);
        const isThere = newest > 0 && (view.state === "draft" || table.publication > 0);
        const plan = isThere ? await api.plan(place, view, signal) : null;
        tell({ revision: newest, readAs: view, plan, ...withTable(new Map(), table), problem: null });
        // Another height may have been chosen meanwhile.
        if (state().model.view !== view) looking.request();
      } catch (error) {
        // A server that is gone, or a session, is the business of whoever follows the map.
        const isItsOwn = error instanceof Refused && error.status !== 401;
        if (!isAborted(error) && isItsOwn) tell({ problem: inWords(error) });
      }
    },
  });

  return {
    look: () => {
      const { layers, draft, editing } = state();
      if (layers.model.on || layers.landmarks.on || draft.open || editing.on) looking.request();
    },
    stop: () => {
      abort.abort();
      looking.stop();
    },
  };
}
