// What the card of changes asks of the server: what robots found against the model, and to accept or dismiss it.

import { inWords, isAborted, type Api } from "./api";
import { changeInWords, type ChangesState } from "./changes";
import { createCoalescer, type Timers } from "./coalesce";
import type { Place } from "./permalink";
import { hasEnded } from "./session";
import { may, samePlace, type State } from "./state";
import type { Dispatch } from "./store";
import type { ModelChange, ModelChangeAnswer } from "./wire";

/** Least time between two questions: each is held against the whole map. */
const INTERVAL_MS = 3_000;

/** What the card can be told to do. */
export interface ChangeActions {
  open: (open: boolean) => void;
  /** The map or the model has gone on. */
  refresh: () => void;
  answer: (change: ModelChange, answer: ModelChangeAnswer) => void;
}

export interface ChangeActionsOptions {
  api: Api;
  state: () => State;
  dispatch: Dispatch;
  timers: Timers;
}

const DONE: Readonly<Record<ModelChangeAnswer, string>> = {
  accept: "Taken into the draft; publish it on the card Model",
  dismiss: "Dismissed",
  reopen: "Told again",
};

export function createChangeActions({ api, state, dispatch, timers }: ChangeActionsOptions): ChangeActions {
  const change = (changes: Partial<ChangesState>): void => {
    dispatch({ kind: "changes", changes });
  };
  const failed = (place: Place, error: unknown): void => {
    if (isAborted(error) || !samePlace(place, state().place) || hasEnded(error, dispatch)) return;
    change({ answering: null, problem: inWords(error) });
  };

  const reading = createCoalescer({
    intervalMs: INTERVAL_MS,
    timers,
    run: async () => {
      const { place, model, changes } = state();
      if (place === null || !changes.open) return;
      try {
        const { changes: list, publication } = await api.changes(place, model.view.heightM);
        if (samePlace(place, state().place)) change({ list, publication });
      } catch (error) {
        failed(place, error);
      }
    },
  });

  const answer = async (about: ModelChange, given: ModelChangeAnswer): Promise<void> => {
    const { place, model, changes } = state();
    if (place === null || changes.answering !== null) return;
    change({ answering: about.id, problem: null, done: null });
    try {
      const { change: now } = await api.answerChange(place, about.id, given, model.view.heightM);
      if (!samePlace(place, state().place)) return;
      const list = state().changes.list?.map((one) => (one.id === now.id ? now : one)) ?? null;
      change({ answering: null, list, done: `${DONE[given]}: ${changeInWords(now)}.` });
    } catch (error) {
      failed(place, error);
    }
    reading.request();
  };

  return {
    open: (open) => {
      if (open === state().changes.open) return;
      change({ open, problem: null, done: null });
      if (open) reading.request();
    },
    refresh: () => {
      if (state().changes.open) reading.request();
    },
    answer: (about, given) => void answer(about, given),
  };
}

/** Whether the operator may answer. */
export function mayAnswer(state: State): boolean {
  return may(state, "map:edit");
}
