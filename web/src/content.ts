// The map of one level as the page holds it, and how patches change it. A patch never changes the
// content in place: what did not change stays the same object, so that drawing can tell.

import { boxAround, union, type Box } from "./geometry";
import type { LayerTile, TileMark } from "./pyramid";
import type { Chain, Cluster, RasterChanges, Segment, TilePlace, VectorPatch } from "./wire";

/** Segments, clusters, chains and tiles of one level. */
export interface Content {
  /** The revision that segments, clusters and chains are at. */
  vectorRevision: number;
  /** The revision that the tiles are at. */
  rasterRevision: number;
  /** How often the tiles were fetched whole: pictures of an earlier epoch are stale whatever their revision. */
  epoch: number;
  segments: ReadonlyMap<string, Segment>;
  clusters: ReadonlyMap<string, Cluster>;
  chains: ReadonlyMap<string, Chain>;
  /** By `tileKey`; tiles that hold no evidence any more stay, marked, as their pictures must change too. */
  tiles: ReadonlyMap<string, TileMark>;
}

/** Before anything was asked for. */
export const NO_CONTENT: Content = {
  vectorRevision: 0,
  rasterRevision: 0,
  epoch: 0,
  segments: new Map(),
  clusters: new Map(),
  chains: new Map(),
  tiles: new Map(),
};

/** A tile's name. */
export function tileKey(tile: LayerTile): string {
  return `${tile.sensor}/${tile.x}/${tile.y}`;
}

function patched<T extends { id: string }>(
  old: ReadonlyMap<string, T>,
  changed: readonly T[],
  removed: readonly string[],
): ReadonlyMap<string, T> {
  if (changed.length === 0 && removed.length === 0) return old;
  const next = new Map(old);
  for (const id of removed) next.delete(id);
  for (const item of changed) next.set(item.id, item);
  return next;
}

/**
 * The content after a vector patch. A patch from 0 is the whole; any other that does not start at
 * the content's own revision belongs to content that is no more, and is left alone.
 */
export function withVector(content: Content, patch: VectorPatch): Content {
  const whole = patch.since === 0;
  if (!whole && patch.since !== content.vectorRevision) return content;
  const base = whole ? NO_CONTENT : content;
  return {
    ...content,
    vectorRevision: patch.revision,
    segments: patched(base.segments, patch.segments, patch.removed.segments ?? []),
    clusters: patched(base.clusters, patch.clusters, patch.removed.clusters ?? []),
    chains: patched(base.chains, patch.chains ?? [], patch.removed.chains ?? []),
  };
}

/** The content after changes of tiles; the same rules as for `withVector`. */
export function withRaster(content: Content, changes: RasterChanges): Content {
  const whole = changes.since === 0;
  if (!whole && changes.since !== content.rasterRevision) return content;
  const gone = [...changes.removed, ...at("prior", changes.removed_prior), ...at("walls", changes.removed_walls)];
  const there = [...changes.tiles, ...at("prior", changes.prior), ...at("walls", changes.walls)];
  if (!whole && there.length === 0 && gone.length === 0) {
    return { ...content, rasterRevision: changes.revision };
  }
  const tiles = new Map(content.tiles);
  if (whole) {
    // What the new whole does not name is gone.
    for (const [key, mark] of tiles) {
      tiles.set(key, { ...mark, revision: changes.revision, present: false });
    }
  }
  for (const address of gone) {
    tiles.set(tileKey(address), { address, revision: changes.revision, present: false });
  }
  for (const address of there) {
    tiles.set(tileKey(address), { address, revision: changes.revision, present: true });
  }
  return {
    ...content,
    rasterRevision: changes.revision,
    epoch: whole ? content.epoch + 1 : content.epoch,
    tiles,
  };
}

function at(sensor: "prior" | "walls", places: readonly TilePlace[] | undefined): LayerTile[] {
  return (places ?? []).map(({ x, y }) => ({ sensor, x, y }));
}

/** Tiles that hold evidence of robots; prior and walls are none. */
export function tileCount(content: Content): number {
  let count = 0;
  for (const { present, address } of content.tiles.values()) {
    if (present && address.sensor !== "prior" && address.sensor !== "walls") count++;
  }
  return count;
}

/** What the map covers, features and tiles; null if there is nothing. */
export function boundsOf(content: Content, tileM: number): Box | null {
  let box = boxAround(content.segments.values(), content.clusters.values());
  for (const { address, present } of content.tiles.values()) {
    if (!present) continue;
    const [left, bottom] = [address.x * tileM, address.y * tileM];
    box = union(box, [left, bottom, left + tileM, bottom + tileM]);
  }
  return box;
}
