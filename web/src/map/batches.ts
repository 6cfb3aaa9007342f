// Segments made ready for drawing: all pieces that look alike in one flat array. Some thousand
// separate features are too slow for a canvas; a handful of strokes is not (see BENCHMARKS).

import { piecesOf } from "../geometry";
import type { Segment } from "../wire";

/** Pieces of one look. */
export interface Batch {
  /** The robot's colour slot; null for what several robots saw. */
  slot: number | null;
  /** x, y, x, y of each piece's ends, in level metres. */
  ends: Float64Array;
}

/** The slot of a thing by who saw it; null if they were several, or nobody the page knows. */
export function slotOf(robots: readonly string[], slots: ReadonlyMap<string, number>): number | null {
  const [only] = robots;
  return robots.length === 1 && only !== undefined ? (slots.get(only) ?? null) : null;
}

/** The batches of segments: what several saw first, so that single sightings lie above it. */
export function batchesOf(segments: Iterable<Segment>, slots: ReadonlyMap<string, number>): Batch[] {
  const endsOf = new Map<number | null, number[]>();
  for (const segment of segments) {
    const slot = slotOf(segment.robots, slots);
    let ends = endsOf.get(slot);
    if (ends === undefined) {
      ends = [];
      endsOf.set(slot, ends);
    }
    for (const piece of piecesOf(segment)) ends.push(...piece);
  }
  return [...endsOf]
    .sort(([a], [b]) => (a ?? -1) - (b ?? -1))
    .map(([slot, ends]) => ({ slot, ends: Float64Array.from(ends) }));
}
