// Pictures of a mock level's tiles, as PNG: free is white, occupied dark, unknown transparent.

import { crc32, deflateSync } from "node:zlib";
import { TILE_CELLS } from "./level.mjs";

const SIDE = 256;

/** @param {string} type @param {Buffer} data */
function chunk(type, data) {
  const body = Buffer.concat([Buffer.from(type, "latin1"), data]);
  const out = Buffer.alloc(body.length + 8);
  out.writeUInt32BE(data.length, 0);
  body.copy(out, 4);
  out.writeUInt32BE(crc32(body), body.length + 4);
  return out;
}

/**
 * RGBA pixels as PNG.
 * @param {Uint8Array} pixels
 */
function encodePng(pixels) {
  const rows = Buffer.alloc(SIDE * (SIDE * 4 + 1));
  for (let row = 0; row < SIDE; row++) rows.set(pixels.subarray(row * SIDE * 4, (row + 1) * SIDE * 4), row * (SIDE * 4 + 1) + 1);
  const header = Buffer.alloc(13);
  header.writeUInt32BE(SIDE, 0);
  header.writeUInt32BE(SIDE, 4);
  header.set([8, 6, 0, 0, 0], 8);
  return Buffer.concat([
    Buffer.from([0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a]),
    chunk("IHDR", header),
    chunk("IDAT", deflateSync(rows)),
    chunk("IEND", Buffer.alloc(0)),
  ]);
}

/**
 * @param {ReadonlyMap<string, import("./level.mjs").Tile>} tiles
 * @param {{ z: number, row: number, col: number, layer: string }} address
 * @returns {{ png: Buffer, revision: number } | null} null where no tile is
 */
export function drawPicture(tiles, { z, row, col, layer }) {
  const cellsPerPx = 2 ** (6 - z);
  const span = SIDE * cellsPerPx;
  const pixels = new Uint8Array(SIDE * SIDE * 4);
  const sums = new Float32Array(SIDE * SIDE);
  let revision = 0;
  for (const { address, revision: changed, cells } of tiles.values()) {
    if (layer !== "all" && layer !== address.sensor) continue;
    const left = address.x * TILE_CELLS - col * span;
    const bottom = address.y * TILE_CELLS + (row + 1) * span;
    if (left + TILE_CELLS <= 0 || left >= span || bottom + TILE_CELLS <= 0 || bottom >= span) continue;
    revision = Math.max(revision, changed);
    for (let cell = 0; cell < cells.length; cell++) {
      const nats = cells[cell] ?? 0;
      if (nats === 0) continue;
      const x = left + (cell % TILE_CELLS);
      const y = bottom + Math.floor(cell / TILE_CELLS);
      const px = Math.floor(x / cellsPerPx);
      const py = SIDE - 1 - Math.floor(y / cellsPerPx);
      if (px < 0 || px >= SIDE || py < 0 || py >= SIDE) continue;
      const at = py * SIDE + px;
      const before = sums[at] ?? 0;
      // The strongest wall in a pixel shows; free space only where there is no wall.
      sums[at] = nats > 0 ? Math.max(before, nats) : before > 0 ? before : Math.min(before, nats);
    }
  }
  if (revision === 0) return null;
  for (let at = 0; at < sums.length; at++) {
    const nats = sums[at] ?? 0;
    if (nats === 0) continue;
    const occupied = 1 / (1 + Math.exp(-nats));
    const grey = Math.round(255 - 205 * occupied);
    pixels.set([grey, grey, grey, 255], at * 4);
  }
  return { png: encodePng(pixels), revision };
}
