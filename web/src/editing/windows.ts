// What the browser keeps of unsent edits, apart for each of its windows: two windows on one level do not keep over each
// other, and what a closed one has left is found by the next that looks. Which windows live is told by the locks that they
// hold; without locks (they are there on secure origins only), all windows share one memory.

import type { Memory } from "./acting";

/** The parts of `navigator.locks` that this takes. */
export interface Locks {
  /** Asks for a lock, and answers whether it was free, or so after a moment; it is then held for as long as the window is there. */
  hold: (name: string) => Promise<boolean>;
  /** The names of all that are held. */
  held: () => Promise<ReadonlySet<string>>;
}

export interface WindowMemoryOptions {
  /** Shared by all windows. */
  shared: Pick<Storage, "getItem" | "setItem" | "removeItem" | "key" | "length">;
  /** Of this window, also after it was loaded anew; a duplicated window has a copy. */
  own: Memory;
  /** Null where there are none. */
  locks: Locks | null;
  newId: () => string;
}

export interface WindowMemory extends Memory {
  /** Told when it is known which windows live: from then on, what others have left is found too. */
  ready: Promise<void>;
}

const OWN = "mapfold.window";
/** How long a page that is loaded anew may have to wait for the one before it to be gone. */
const RELOAD_MS = 1_500;

/** The lock of a window. */
export function lockOf(id: string): string {
  return `mapfold.window.${id}`;
}

export function createWindowMemory({ shared, own, locks, newId }: WindowMemoryOptions): WindowMemory {
  if (locks === null) {
    return {
      getItem: (name) => shared.getItem(name),
      setItem: (name, text) => {
        shared.setItem(name, text);
      },
      removeItem: (name) => {
        shared.removeItem(name);
      },
      ready: Promise.resolve(),
    };
  }
  let id = own.getItem(OWN) ?? newId();
  // Until it is known, everybody lives.
  let living: ReadonlySet<string> | null = null;
  const nameOf = (name: string): string => `${name}#${id}`;
  const left = (name: string): string | null => {
    if (living === null) return null;
    for (let index = 0; index < shared.length; index++) {
      const other = shared.key(index) ?? "";
      const whose = other.startsWith(`${name}#`) ? other.slice(name.length + 1) : other === name ? "" : null;
      if (whose !== null && whose !== id && !living.has(lockOf(whose))) return other;
    }
    return null;
  };
  const settle = async (): Promise<void> => {
    // A duplicate has the identity of the window that it was made from: it takes one of its own.
    if (!(await locks.hold(lockOf(id)))) {
      id = newId();
      await locks.hold(lockOf(id));
    }
    own.setItem(OWN, id);
    living = await locks.held();
  };
  return {
    getItem: (name) => {
      const mine = shared.getItem(nameOf(name));
      if (mine !== null) return mine;
      const other = left(name);
      if (other === null) return null;
      // From now on it is kept by this window.
      const text = shared.getItem(other);
      if (text !== null) shared.setItem(nameOf(name), text);
      shared.removeItem(other);
      return text;
    },
    setItem: (name, text) => {
      shared.setItem(nameOf(name), text);
    },
    removeItem: (name) => {
      shared.removeItem(nameOf(name));
    },
    ready: settle(),
  };
}

/** The browser's locks; null where there are none. */
export function locksOf(manager: LockManager | undefined): Locks | null {
  if (manager === undefined) return null;
  return {
    hold: (name) =>
      new Promise((told) => {
        const held = manager.request(name, { signal: AbortSignal.timeout(RELOAD_MS) }, () => {
          told(true);
          // Until the window is gone.
          return new Promise<void>(() => undefined);
        });
        held.catch(() => {
          told(false);
        });
      }),
    held: async () => new Set(((await manager.query()).held ?? []).map(({ name }) => name ?? "")),
  };
}
