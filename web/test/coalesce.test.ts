import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { createCoalescer, type Coalescer, type Timers } from "../src/coalesce";

const timers: Timers = {
  setTimeout: (run, delayMs) => setTimeout(run, delayMs) as unknown as number,
  clearTimeout: (timer) => {
    clearTimeout(timer);
  },
};

let runs: number;
let finish: (() => void)[];
let coalescer: Coalescer;

beforeEach(() => {
  vi.useFakeTimers();
  runs = 0;
  finish = [];
  coalescer = createCoalescer({
    intervalMs: 250,
    timers,
    run: () => {
      runs++;
      return new Promise((resolve) => finish.push(resolve));
    },
  });
});
afterEach(() => {
  vi.useRealTimers();
});

const finishRun = async (): Promise<void> => {
  finish.shift()?.();
  await vi.advanceTimersByTimeAsync(0);
};

describe("a coalescer", () => {
  it("runs at once", () => {
    coalescer.request();
    expect(runs).toBe(1);
  });

  it("turns a burst into one run and one more", async () => {
    for (let i = 0; i < 100; i++) coalescer.request();
    expect(runs).toBe(1);
    await finishRun();
    expect(runs).toBe(1);
    await vi.advanceTimersByTimeAsync(249);
    expect(runs).toBe(1);
    await vi.advanceTimersByTimeAsync(1);
    expect(runs).toBe(2);
    await finishRun();
    await vi.advanceTimersByTimeAsync(10_000);
    expect(runs).toBe(2);
  });

  it("never runs twice at a time, however long a run takes", async () => {
    coalescer.request();
    await vi.advanceTimersByTimeAsync(1_000);
    coalescer.request();
    expect(runs).toBe(1);
    await finishRun();
    expect(runs).toBe(2);
  });

  it("misses no request that comes during a run", async () => {
    coalescer.request();
    await vi.advanceTimersByTimeAsync(300);
    coalescer.request();
    coalescer.request();
    await finishRun();
    await finishRun();
    await vi.advanceTimersByTimeAsync(300);
    expect(runs).toBe(2);
  });

  it("runs no more once stopped", async () => {
    coalescer.request();
    coalescer.request();
    coalescer.stop();
    await finishRun();
    await vi.advanceTimersByTimeAsync(1_000);
    coalescer.request();
    expect(runs).toBe(1);
  });
});
