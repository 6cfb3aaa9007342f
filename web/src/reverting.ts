// What the log panel asks of the server: lines of the log, what a revert would change, reverts and
// their undoing. A question that another one overtakes is called off.

import { inWords, isAborted, Refused, type Api } from "./api";
import { NO_LOG, previewInWords, targetsOf, type LogState, type Trial } from "./reverts";
import { hasEnded } from "./session";
import { may, type State } from "./state";
import type { Dispatch } from "./store";
import { counted } from "./words";

/** Lines of the log that are asked for at once. */
const PAGE = 100;
/** Lines that are asked for again when the log goes on. */
const AGAIN_MOST = 1000;

/** What the panel can be told to do. */
export interface LogActions {
  open: () => void;
  close: () => void;
  /** Lists other contributions, or means others. */
  choose: (choice: Partial<Pick<LogState, "robot" | "from" | "to">>) => void;
  tick: (id: string, on: boolean) => void;
  more: () => void;
  /** The log has gone on. */
  refresh: () => void;
  tryOut: (trial: Trial) => void;
  /** Drops what was tried out. */
  cancel: () => void;
  /** Does what was tried out. */
  confirm: () => void;
}

export interface LogActionsOptions {
  api: Api;
  state: () => State;
  dispatch: Dispatch;
  uuid: () => string;
}

export function createLogActions({ api, state, dispatch, uuid }: LogActionsOptions): LogActions {
  let listing = new AbortController();
  let asking = new AbortController();
  /** The id of the revert that is being sent: sent again after a failure, it is still the same. */
  let sending: { id: string; what: string } | null = null;

  const change = (log: Partial<LogState>): void => {
    dispatch({ kind: "log", log });
  };
  const failed = (error: unknown): void => {
    if (isAborted(error) || hasEnded(error, dispatch)) return;
    // What the server refuses for good must be tried out again; what it cannot do now, only sent again.
    const overtaken = error instanceof Refused && error.status < 500;
    change({ busy: null, problem: inWords(error), ...(overtaken ? { preview: null } : {}) });
  };

  const list = async (limit: number, cursor: string | null): Promise<void> => {
    const { place, log } = state();
    if (place === null) return;
    listing.abort();
    listing = new AbortController();
    const { signal } = listing;
    try {
      const filter = { limit, ...(log.robot === "" ? {} : { robot: log.robot }), ...(cursor === null ? {} : { cursor }) };
      const [page, reverts] = await Promise.all([api.contributions(place, filter, signal), api.reverts(place, signal)]);
      if (signal.aborted) return;
      const before = cursor === null ? [] : (state().log.entries ?? []);
      change({ entries: [...before, ...page.contributions], next: page.next ?? null, reverts: reverts.reverts });
    } catch (error) {
      failed(error);
    }
  };

  /** Runs a question of which there is only one at a time. */
  const ask = async (busy: string, run: (signal: AbortSignal) => Promise<void>): Promise<void> => {
    asking.abort();
    const own = new AbortController();
    asking = own;
    change({ busy, problem: null, done: null });
    try {
      await run(own.signal);
    } catch (error) {
      if (!own.signal.aborted) failed(error);
    }
  };

  const tryOut = async (trial: Trial): Promise<void> => {
    const { place, log } = state();
    const targets = targetsOf(log);
    if (place === null || (trial.kind === "revert" && targets === null)) return;
    await ask("Working out what would change …", async (signal) => {
      const told =
        trial.kind === "undo"
          ? await api.previewUndo(place, trial.revert, signal)
          : await api.previewRevert(place, { ...targets, reason: "" }, signal);
      if (!signal.aborted) change({ busy: null, preview: { trial, told } });
    });
  };

  const confirm = async (): Promise<void> => {
    const { place, log } = state();
    const targets = targetsOf(log);
    if (place === null || log.preview === null || log.busy !== null) return;
    const { trial } = log.preview;
    if (trial.kind === "undo") {
      await ask("Putting back …", async () => {
        const { undone } = await api.undoRevert(place, trial.revert);
        const back = counted(undone?.put_back ?? 0, "contribution");
        change({ busy: null, preview: null, done: `Put back: ${back}, at revision ${undone?.revision ?? 0}.` });
        await list(PAGE, null);
      });
      return;
    }
    const reason = log.reason.trim();
    if (targets === null || reason === "") return;
    const what = JSON.stringify([place, targets, reason]);
    sending = sending?.what === what ? sending : { id: uuid(), what };
    const { id } = sending;
    await ask("Taking out …", async () => {
      const revert = await api.revert(place, { ...targets, id, reason });
      sending = null;
      const out = counted(revert.taken_out, "contribution");
      change({
        busy: null,
        preview: null,
        reason: "",
        ticked: NO_LOG.ticked,
        done: `Taken out: ${out}, at revision ${revert.revision}. It can be undone below.`,
      });
      await list(PAGE, null);
    });
  };

  /** What was tried out was something else. */
  const outdated = { preview: null, busy: null, problem: null, done: null };

  return {
    open: () => {
      change({ open: true });
      void list(PAGE, null);
    },
    close: () => {
      listing.abort();
      asking.abort();
      dispatch({ kind: "log", log: { ...NO_LOG } });
    },
    choose: (choice) => {
      asking.abort();
      const other = choice.robot !== undefined && choice.robot !== state().log.robot;
      change({ ...outdated, ...choice, ...(other ? { entries: null, next: null, ticked: NO_LOG.ticked } : {}) });
      if (other) void list(PAGE, null);
    },
    tick: (id, on) => {
      asking.abort();
      const ticked = new Set(state().log.ticked);
      if (on) ticked.add(id);
      else ticked.delete(id);
      change({ ...outdated, ticked });
    },
    more: () => {
      const { next } = state().log;
      if (next !== null) void list(PAGE, next);
    },
    refresh: () => {
      if (state().log.open) void list(Math.min(AGAIN_MOST, Math.max(PAGE, state().log.entries?.length ?? 0)), null);
    },
    tryOut: (trial) => void tryOut(trial),
    cancel: () => {
      asking.abort();
      change(outdated);
    },
    confirm: () => void confirm(),
  };
}

/** Whether who is signed in may take contributions out. */
export function mayRevert(state: State): boolean {
  return may(state, "map:edit");
}

/** What was tried out, in words; empty if nothing was. */
export function shownPreview(state: State): string[] {
  const { preview } = state.log;
  return preview === null ? [] : previewInWords(preview, (robot) => nameOf(state, robot));
}

/** A robot's name for people. */
export function nameOf(state: State, robot: string): string {
  return state.robots.find((one) => one.robot === robot)?.name ?? robot;
}
