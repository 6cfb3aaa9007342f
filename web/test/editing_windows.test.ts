import { describe, expect, it } from "vitest";
import { createWindowMemory, lockOf, type Locks, type WindowMemory } from "../src/editing/windows";

/** A browser: a storage that all windows share, and locks. */
function browser(): { open: (own?: Map<string, string>, withLocks?: boolean) => WindowMemory & { close: () => void; session: Map<string, string> }; shared: Map<string, string> } {
  const [shared, held] = [new Map<string, string>(), new Set<string>()];
  let made = 0;
  const storage = (map: Map<string, string>): Storage => ({
    getItem: (name) => map.get(name) ?? null,
    setItem: (name, text) => void map.set(name, text),
    removeItem: (name) => void map.delete(name),
    key: (index) => [...map.keys()][index] ?? null,
    clear: () => {
      map.clear();
    },
    get length() {
      return map.size;
    },
  });
  return {
    shared,
    open: (own = new Map(), withLocks = true) => {
      const mine: string[] = [];
      const locks: Locks = {
        hold: (name) => {
          if (held.has(name)) return Promise.resolve(false);
          held.add(name);
          mine.push(name);
          return Promise.resolve(true);
        },
        held: () => Promise.resolve(new Set(held)),
      };
      const memory = createWindowMemory({ shared: storage(shared), own: storage(own), locks: withLocks ? locks : null, newId: () => `w${made++}` });
      return { ...memory, session: own, close: () => { for (const name of mine) held.delete(name); } };
    },
  };
}

const KEY = "mapfold.edits.plant.ground";

describe("what windows keep", () => {
  it("is kept apart, and found by the same window after a reload", async () => {
    const { open, shared } = browser();
    const [a, b] = [open(), open()];
    await Promise.all([a.ready, b.ready]);
    a.setItem(KEY, "of a");
    b.setItem(KEY, "of b");
    expect([a.getItem(KEY), b.getItem(KEY), shared.size]).toEqual(["of a", "of b", 2]);
    a.close();
    const again = open(a.session);
    await again.ready;
    expect(again.getItem(KEY)).toBe("of a");
    b.removeItem(KEY);
    expect(b.getItem(KEY)).toBeNull();
  });

  it("is taken over from a window that is closed, and never from one that lives", async () => {
    const { open, shared } = browser();
    const a = open();
    await a.ready;
    a.setItem(KEY, "of a");
    const b = open();
    expect(b.getItem(KEY)).toBeNull();
    await b.ready;
    expect(b.getItem(KEY)).toBeNull();
    a.close();
    const c = open();
    await c.ready;
    expect(c.getItem(KEY)).toBe("of a");
    expect([...shared.values()]).toEqual(["of a"]);
    expect(c.getItem("mapfold.edits.plant.upper")).toBeNull();
  });

  it("of a duplicated window is its own", async () => {
    const { open } = browser();
    const a = open();
    await a.ready;
    a.setItem(KEY, "of a");
    const duplicate = open(new Map(a.session));
    await duplicate.ready;
    duplicate.setItem(KEY, "of the duplicate");
    expect(a.getItem(KEY)).toBe("of a");
    expect(duplicate.session.get("mapfold.window")).not.toBe(a.session.get("mapfold.window"));
  });

  it("of earlier versions of the page is found, and without locks there is one memory", async () => {
    const { open, shared } = browser();
    shared.set(KEY, "kept by an earlier page");
    const plain = open(new Map(), false);
    expect(plain.getItem(KEY)).toBe("kept by an earlier page");
    const a = open();
    await a.ready;
    expect(a.getItem(KEY)).toBe("kept by an earlier page");
    expect(lockOf("x")).toBe("mapfold.window.x");
  });
});
