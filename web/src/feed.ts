// Follows one level: opens its live events, and after each asks for what changed since the state's
// own revision. Events are only hints: whatever is missed, the next question brings, so that a
// broken stream, a sleeping tablet or a restarted server need no care of their own.

import { eventsPath, inWords, isAborted, Refused, type Api } from "./api";
import { createCoalescer, type Timers } from "./coalesce";
import type { Place } from "./permalink";
import { hasEnded } from "./session";
import { robotsHere, type Link, type State } from "./state";
import type { Dispatch } from "./store";
import type { LevelEvent } from "./wire";

/** Least time between two questions for the map, and for the log. */
const MAP_INTERVAL_MS = 250;
const LOG_INTERVAL_MS = 1_000;
/** Robots tell where they are also when nothing changes on the map. */
const ROBOTS_MS = 2_000;
/** A look at the level even if no event comes, should events be held up on their way. */
const BACKSTOP_MS = 15_000;
/** Waits before the stream is opened again; the last one repeats. */
const RETRY_MS = [500, 1_000, 2_000, 4_000, 8_000];
/** Lines of the log that the page shows. */
const LOG_LINES = 20;

/** What the feed needs of the rest of the page. */
export interface FeedOptions {
  place: Place;
  api: Api;
  state: () => State;
  dispatch: Dispatch;
  openEvents: (path: string) => EventSource;
  timers: Timers;
}

/** Follows `place` until the answer is called. */
export function followLevel(options: FeedOptions): () => void {
  const { place, api, state, timers } = options;
  const abort = new AbortController();
  const { signal } = abort;
  const dispatch: Dispatch = (event) => {
    if (!signal.aborted) options.dispatch(event);
  };

  let events: EventSource | null = null;
  let whole = true;
  let failures = 0;
  let retryTimer: number | null = null;
  let backstopTimer: number | null = null;
  let robotsTimer: number | null = null;
  const askedFor = new Set<string>();

  const setLink = (link: Link): void => {
    dispatch({ kind: "link", link });
  };

  const lost = (problem: string): void => {
    if (signal.aborted) return;
    events?.close();
    events = null;
    const before = state().link;
    setLink({ kind: "lost", sinceMs: before.kind === "lost" ? before.sinceMs : api.nowMs(), problem });
    if (retryTimer !== null) return;
    const wait = RETRY_MS[Math.min(failures, RETRY_MS.length - 1)] ?? 0;
    failures++;
    retryTimer = timers.setTimeout(() => {
      retryTimer = null;
      open();
    }, wait);
  };

  const failed = (error: unknown): void => {
    if (signal.aborted || isAborted(error) || hasEnded(error, dispatch)) return;
    if (error instanceof Refused && error.status < 500) dispatch({ kind: "trouble", trouble: inWords(error) });
    lost(inWords(error));
  };

  const askLevel = async (): Promise<void> => {
    const level = await api.level(place, signal);
    const known = state().level;
    // Another frame, or a past that is no longer there: the level was replaced behind our back.
    if (known !== null && (known.frame !== level.frame || level.folded_revision < state().content.vectorRevision)) {
      whole = true;
    }
    dispatch({ kind: "level", level });
  };

  /** Finds out when each robot was last heard, once; from then on events tell. */
  const askWhenHeard = async (): Promise<void> => {
    for (const { robot } of robotsHere(state())) {
      if (askedFor.has(robot)) continue;
      askedFor.add(robot);
      const page = await api.contributions(place, { limit: 1, robot }, signal);
      const last = page.contributions.at(0);
      if (last?.robot === robot) {
        dispatch({ kind: "heard", robots: [robot], atMs: Date.parse(last.received_at) });
      }
    }
  };

  const map = createCoalescer({
    intervalMs: MAP_INTERVAL_MS,
    timers,
    run: async () => {
      let fromStart = false;
      try {
        if (whole || state().level === null) await askLevel();
        // From here on `whole` is about the next run: the level may turn out to be another meanwhile.
        fromStart = whole;
        whole = false;
        const { vectorRevision, rasterRevision } = state().content;
        const [patch, changes, robots] = await Promise.all([
          api.vector(place, fromStart ? 0 : vectorRevision, signal),
          api.raster(place, fromStart ? 0 : rasterRevision, signal),
          api.robots(place, signal),
        ]);
        failures = 0;
        dispatch({ kind: "robots", robots });
        dispatch({ kind: "vector", patch });
        dispatch({ kind: "raster", changes });
        await askWhenHeard();
      } catch (error) {
        whole ||= fromStart;
        if (error instanceof Refused && error.status === 410) {
          whole = true;
          map.request();
        } else {
          failed(error);
        }
      }
    },
  });

  const log = createCoalescer({
    intervalMs: LOG_INTERVAL_MS,
    timers,
    run: async () => {
      try {
        await askLevel();
        const page = await api.contributions(place, { limit: LOG_LINES }, signal);
        dispatch({ kind: "contributions", contributions: page.contributions });
        const folded = state().level?.folded_revision ?? 0;
        if (whole || folded > state().content.vectorRevision) map.request();
      } catch (error) {
        failed(error);
      }
    },
  });

  const open = (): void => {
    if (signal.aborted) return;
    const stream = options.openEvents(eventsPath(place));
    events = stream;
    stream.addEventListener("open", () => {
      setLink({ kind: "live" });
      map.request();
      log.request();
    });
    stream.addEventListener("revision", (message) => {
      const event = JSON.parse((message as MessageEvent<string>).data) as LevelEvent;
      dispatch({ kind: "heard", robots: event.robots, atMs: api.nowMs() });
      map.request();
      log.request();
    });
    stream.addEventListener("resync", () => {
      whole = true;
      map.request();
      log.request();
    });
    stream.addEventListener("error", () => {
      if (events !== stream) return;
      const before = state().link;
      lost(before.kind === "lost" ? before.problem : "The live stream is interrupted.");
      // Says whether the server is gone, or the session.
      log.request();
    });
  };

  const backstop = (): void => {
    backstopTimer = timers.setTimeout(() => {
      if (state().link.kind === "live") log.request();
      backstop();
    }, BACKSTOP_MS);
  };

  const askRobots = (): void => {
    robotsTimer = timers.setTimeout(() => {
      void (async () => {
        try {
          if (state().link.kind === "live") dispatch({ kind: "robots", robots: await api.robots(place, signal) });
        } catch (error) {
          failed(error);
        }
        if (!signal.aborted) askRobots();
      })();
    }, ROBOTS_MS);
  };

  setLink({ kind: "connecting" });
  map.request();
  log.request();
  open();
  backstop();
  askRobots();

  return () => {
    abort.abort();
    events?.close();
    map.stop();
    log.stop();
    if (retryTimer !== null) timers.clearTimeout(retryTimer);
    if (backstopTimer !== null) timers.clearTimeout(backstopTimer);
    if (robotsTimer !== null) timers.clearTimeout(robotsTimer);
  };
}
