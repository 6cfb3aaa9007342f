// The picture pyramid of the raster: which pictures cover what, and which ones a change touches.
// A picture at (z, row, col) has 256 x 256 pixels of resolution_m * 2^(6 - z) metres; columns count
// to the right and rows DOWN from the level's origin; both may be negative.

import type { Box } from "./geometry";
import type { SensorClass } from "./wire";

/** Pixels along a picture's side. */
export const PICTURE_PX = 256;

/** The zoom level at which a pixel is a cell. Finer levels show the same cells larger, and the page can do that itself. */
export const Z_CELL = 6;

/** A picture's place in the pyramid. */
export interface PictureAddress {
  z: number;
  row: number;
  col: number;
}

/** A layer of the raster: what sensors of one class saw, the prior, which no robot saw, or what confirmed walls say. */
export type LayerId = SensorClass | "prior" | "walls";

/** Which evidence a picture shows; walls by themselves are drawn as segments. */
export type Evidence = "all" | Exclude<LayerId, "walls">;

/** The choices of evidence, as permalinks and pictures name them. */
export const EVIDENCE: readonly Evidence[] = ["all", "scanner", "sonar", "prior"];

/** One layer's tile. */
export interface LayerTile {
  sensor: LayerId;
  x: number;
  y: number;
}

/** A tile as the page knows it: the revision of its last change, and whether it still holds evidence. */
export interface TileMark {
  address: LayerTile;
  revision: number;
  present: boolean;
}

/** What the page knows of a picture from its tiles. */
export interface PictureMark {
  revision: number;
  present: boolean;
}

/** Metres per pixel. */
export function pictureResolution(z: number, cellM: number): number {
  return cellM * 2 ** (Z_CELL - z);
}

/** The coarsest zoom level that is still sharp at `resolution` metres per device pixel. */
export function zFor(resolution: number, cellM: number): number {
  const exact = Z_CELL - Math.log2(resolution / cellM);
  // A quarter of a level of blur is invisible and saves pictures.
  return Math.min(Z_CELL, Math.max(0, Math.ceil(exact - 0.25)));
}

/** A name for a picture, the same as the end of its path. */
export function pictureKey({ z, row, col }: PictureAddress): string {
  return `${z}/${row}/${col}`;
}

/** The part of the level that a picture shows. */
export function pictureBox({ z, row, col }: PictureAddress, cellM: number): Box {
  const spanM = PICTURE_PX * pictureResolution(z, cellM);
  return [col * spanM, -(row + 1) * spanM, (col + 1) * spanM, -row * spanM];
}

/** The integer at or below a number; never a negative zero. */
function floor(value: number): number {
  return Math.floor(value) + 0;
}

/** The pictures that cover a box at one zoom level, row by row. */
export function picturesOver(box: Box, z: number, cellM: number): PictureAddress[] {
  const spanM = PICTURE_PX * pictureResolution(z, cellM);
  const pictures: PictureAddress[] = [];
  for (let row = floor(-box[3] / spanM); row <= Math.ceil(-box[1] / spanM) - 1; row++) {
    for (let col = floor(box[0] / spanM); col <= Math.ceil(box[2] / spanM) - 1; col++) {
      pictures.push({ z, row, col });
    }
  }
  return pictures;
}

/** The pictures at one zoom level that a tile lies in. */
export function picturesTouched(tile: LayerTile, z: number, tileCells: number): PictureAddress[] {
  const pictureCells = PICTURE_PX * 2 ** (Z_CELL - z);
  const pictures: PictureAddress[] = [];
  const rowLast = Math.ceil((-tile.y * tileCells) / pictureCells) - 1;
  const colLast = Math.ceil(((tile.x + 1) * tileCells) / pictureCells) - 1;
  for (let row = floor((-(tile.y + 1) * tileCells) / pictureCells); row <= rowLast; row++) {
    for (let col = floor((tile.x * tileCells) / pictureCells); col <= colLast; col++) {
      pictures.push({ z, row, col });
    }
  }
  return pictures;
}

/** What the tiles say about the pictures of one zoom level: when each last changed, and whether there is anything on it. */
export function pictureMarks(
  tiles: Iterable<TileMark>,
  options: { z: number; evidence: Evidence; tileCells: number },
): Map<string, PictureMark> {
  const marks = new Map<string, PictureMark>();
  for (const tile of tiles) {
    if (options.evidence !== "all" && tile.address.sensor !== options.evidence) continue;
    for (const picture of picturesTouched(tile.address, options.z, options.tileCells)) {
      const key = pictureKey(picture);
      const mark = marks.get(key);
      if (mark === undefined) {
        marks.set(key, { revision: tile.revision, present: tile.present });
      } else {
        mark.revision = Math.max(mark.revision, tile.revision);
        mark.present ||= tile.present;
      }
    }
  }
  return marks;
}
