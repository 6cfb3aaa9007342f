// Work that is asked for more often than it is worth doing: one run at a time, runs at least an
// interval apart, and always one more run after the last request.

/** Timers; the window's, or a test's. */
export interface Timers {
  setTimeout: (run: () => void, delayMs: number) => number;
  clearTimeout: (timer: number) => void;
}

export interface Coalescer {
  /** Asks for a run. */
  request: () => void;
  /** No run starts any more. */
  stop: () => void;
}

export interface CoalescerOptions {
  /** The work. What it throws is its own business: it must not reject. */
  run: () => Promise<void>;
  /** Least time from the start of one run to the start of the next. */
  intervalMs: number;
  timers: Timers;
}

export function createCoalescer({ run, intervalMs, timers }: CoalescerOptions): Coalescer {
  let running = false;
  let wanted = false;
  let timer: number | null = null;
  let stopped = false;

  const start = (): void => {
    if (stopped) return;
    if (running || timer !== null) {
      wanted = true;
      return;
    }
    wanted = false;
    running = true;
    timer = timers.setTimeout(() => {
      timer = null;
      next();
    }, intervalMs);
    void run().finally(() => {
      running = false;
      next();
    });
  };
  const next = (): void => {
    if (wanted) start();
  };

  return {
    request: start,
    stop() {
      stopped = true;
      if (timer !== null) timers.clearTimeout(timer);
      timer = null;
    },
  };
}
