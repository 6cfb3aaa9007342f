// Pictures of the raster that the page holds: fetches those that are wanted and missing or stale, a
// few at a time, and keeps showing the old one until the new one is there, so that nothing flickers.

import type { Timers } from "../coalesce";
import { pictureKey, type PictureAddress, type PictureMark } from "../pyramid";

/** A picture that is on the screen. */
export interface Wanted {
  address: PictureAddress;
  mark: PictureMark;
}

export interface PicturesOptions<T> {
  /** Fetches a picture; null where there is nothing to see. */
  load: (address: PictureAddress) => Promise<T | null>;
  /** A picture that will not be drawn again. */
  discard: (picture: T) => void;
  /** Something new may be drawn. */
  onLoaded: () => void;
  timers: Timers;
}

export interface Pictures<T> {
  /** Says what is on the screen now, most important first. */
  want: (wanted: readonly Wanted[], epoch: number) => void;
  /** A picture, be it stale; undefined if there is none. */
  get: (address: PictureAddress) => T | undefined;
  /** Pictures held, and pictures wanted that are missing or stale. */
  counts: () => { loaded: number; pending: number };
  /** Forgets all of them, and what is still on its way. */
  clear: () => void;
}

interface Held<T> {
  picture: T | null;
  epoch: number;
  revision: number;
}

const PARALLEL = 6;
/** At 256 kB each. */
const HELD_MOST = 256;
const RETRY_MS = 2_000;

export function createPictures<T>(options: PicturesOptions<T>): Pictures<T> {
  /** In the order they came: the oldest that is not on the screen goes first. */
  const held = new Map<string, Held<T>>();
  const loading = new Set<string>();
  const resting = new Set<string>();
  let wanted: readonly Wanted[] = [];
  let epoch = 0;
  let generation = 0;

  const isCurrent = (key: string, mark: PictureMark): boolean => {
    const have = held.get(key);
    return have?.epoch === epoch && have.revision >= mark.revision;
  };

  const put = (key: string, entry: Held<T>): void => {
    const before = held.get(key)?.picture;
    if (before != null) options.discard(before);
    held.delete(key);
    held.set(key, entry);
    if (held.size <= HELD_MOST) return;
    const shown = new Set(wanted.map(({ address }) => pictureKey(address)));
    for (const [oldest, { picture }] of held) {
      if (held.size <= HELD_MOST) break;
      if (shown.has(oldest)) continue;
      if (picture !== null) options.discard(picture);
      held.delete(oldest);
    }
  };

  const loadOne = async ({ address, mark }: Wanted): Promise<void> => {
    const key = pictureKey(address);
    // What the server answers is at least as new as what the page knew when it asked.
    const asked = { generation, epoch, revision: mark.revision };
    loading.add(key);
    try {
      const picture = await options.load(address);
      if (asked.generation !== generation) {
        if (picture !== null) options.discard(picture);
        return;
      }
      put(key, { picture, epoch: asked.epoch, revision: asked.revision });
    } catch {
      if (asked.generation !== generation) return;
      // The feed tells the operator when the server is gone; here it is enough to try again.
      resting.add(key);
      options.timers.setTimeout(() => {
        resting.delete(key);
        fill();
      }, RETRY_MS);
    } finally {
      if (asked.generation === generation) {
        loading.delete(key);
        options.onLoaded();
        fill();
      }
    }
  };

  const fill = (): void => {
    for (const one of wanted) {
      if (loading.size >= PARALLEL) return;
      const key = pictureKey(one.address);
      if (!loading.has(key) && !resting.has(key) && !isCurrent(key, one.mark)) void loadOne(one);
    }
  };

  return {
    want(now, ofEpoch) {
      wanted = now;
      epoch = ofEpoch;
      fill();
    },
    get(address) {
      return held.get(pictureKey(address))?.picture ?? undefined;
    },
    counts() {
      const pending = wanted.filter(({ address, mark }) => !isCurrent(pictureKey(address), mark)).length;
      let loaded = 0;
      for (const { picture } of held.values()) if (picture !== null) loaded++;
      return { loaded, pending };
    },
    clear() {
      generation++;
      for (const { picture } of held.values()) if (picture !== null) options.discard(picture);
      held.clear();
      loading.clear();
      resting.clear();
      wanted = [];
    },
  };
}
