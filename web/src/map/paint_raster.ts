// Paints the raster from pictures of the pyramid. Where a picture has not come yet, a coarser one
// stands in, or the finer ones that are there.

import {
  PICTURE_PX,
  pictureBox,
  pictureKey,
  pictureResolution,
  picturesOver,
  zFor,
  type PictureAddress,
  type PictureMark,
} from "../pyramid";
import { boxShown, xScreenFromLevel, yScreenFromLevel, type Frame } from "./frame";
import type { Pictures, Wanted } from "./pictures";

export interface RasterScene {
  pictures: Pictures<CanvasImageSource>;
  /** What the tiles say about the pictures of a zoom level. */
  marks: (z: number) => ReadonlyMap<string, PictureMark>;
  cellM: number;
  epoch: number;
}

/** Paints what is there, and says which pictures should be. */
export function paintRaster(frame: Frame, scene: RasterScene): void {
  const { pen } = frame;
  const z = zFor(frame.resolution / frame.pixelRatio, scene.cellM);
  const marks = scene.marks(z);
  const wanted: Wanted[] = [];
  pen.imageSmoothingEnabled = pictureResolution(z, scene.cellM) < frame.resolution / frame.pixelRatio;
  pen.imageSmoothingQuality = "medium";
  for (const address of picturesOver(boxShown(frame, 0), z, scene.cellM)) {
    const mark = marks.get(pictureKey(address));
    if (mark?.present !== true) continue;
    wanted.push({ address, mark });
    if (paintPicture(frame, scene, address)) continue;
    if (!paintFromCoarser(frame, scene, address)) paintFromFiner(frame, scene, address);
  }
  const [x, y] = frame.centreLevel;
  const distance = ({ address }: Wanted): number => {
    const [left, bottom, right, top] = pictureBox(address, scene.cellM);
    return Math.hypot((left + right) / 2 - x, (bottom + top) / 2 - y);
  };
  scene.pictures.want(wanted.sort((a, b) => distance(a) - distance(b)), scene.epoch);
}

/** A rectangle on the screen whose edges lie on device pixels, so that neighbours neither gape nor overlap. */
function screenBox(frame: Frame, address: PictureAddress, cellM: number): [number, number, number, number] {
  const [left, bottom, right, top] = pictureBox(address, cellM);
  const snap = (px: number): number => Math.round(px * frame.pixelRatio) / frame.pixelRatio;
  const x0 = snap(xScreenFromLevel(frame, left));
  const y0 = snap(yScreenFromLevel(frame, top));
  return [x0, y0, snap(xScreenFromLevel(frame, right)) - x0, snap(yScreenFromLevel(frame, bottom)) - y0];
}

function paintPicture(frame: Frame, scene: RasterScene, address: PictureAddress): boolean {
  const picture = scene.pictures.get(address);
  if (picture === undefined) return false;
  frame.pen.drawImage(picture, ...screenBox(frame, address, scene.cellM));
  return true;
}

function paintFromCoarser(frame: Frame, scene: RasterScene, address: PictureAddress): boolean {
  for (let up = 1; up <= address.z; up++) {
    const parent = { z: address.z - up, row: address.row >> up, col: address.col >> up };
    const picture = scene.pictures.get(parent);
    if (picture === undefined) continue;
    const sidePx = PICTURE_PX / 2 ** up;
    const xPx = (address.col - parent.col * 2 ** up) * sidePx;
    const yPx = (address.row - parent.row * 2 ** up) * sidePx;
    frame.pen.drawImage(picture, xPx, yPx, sidePx, sidePx, ...screenBox(frame, address, scene.cellM));
    return true;
  }
  return false;
}

function paintFromFiner(frame: Frame, scene: RasterScene, address: PictureAddress): void {
  for (const [row, col] of [[0, 0], [0, 1], [1, 0], [1, 1]] as const) {
    paintPicture(frame, scene, { z: address.z + 1, row: 2 * address.row + row, col: 2 * address.col + col });
  }
}
