// What a painter paints on: a canvas, and which part of the level it shows. Pixels are CSS pixels,
// x right and y DOWN; the level is in metres, x right and y UP.

import type { Box, Point } from "../geometry";

/** The 2D context of a canvas, as far as painters use it. */
export type Pen = Pick<
  CanvasRenderingContext2D,
  | "beginPath"
  | "moveTo"
  | "lineTo"
  | "closePath"
  | "ellipse"
  | "arc"
  | "roundRect"
  | "stroke"
  | "fill"
  | "fillText"
  | "measureText"
  | "drawImage"
  | "setLineDash"
  | "save"
  | "restore"
  | "translate"
  | "rotate"
  | "strokeStyle"
  | "fillStyle"
  | "lineWidth"
  | "lineCap"
  | "lineJoin"
  | "globalAlpha"
  | "font"
  | "textAlign"
  | "textBaseline"
  | "imageSmoothingEnabled"
  | "imageSmoothingQuality"
>;

export interface Frame {
  pen: Pen;
  widthPx: number;
  heightPx: number;
  /** The level's point in the middle of the canvas. */
  centreLevel: Point;
  /** Metres per CSS pixel. */
  resolution: number;
  /** Device pixels per CSS pixel. */
  pixelRatio: number;
}

/** Where an x of the level is on the screen. */
export function xScreenFromLevel(frame: Frame, xLevelM: number): number {
  return frame.widthPx / 2 + (xLevelM - frame.centreLevel[0]) / frame.resolution;
}

/** Where a y of the level is on the screen. */
export function yScreenFromLevel(frame: Frame, yLevelM: number): number {
  return frame.heightPx / 2 - (yLevelM - frame.centreLevel[1]) / frame.resolution;
}

/** The part of the level that is on the screen, and `marginPx` around it. */
export function boxShown(frame: Frame, marginPx: number): Box {
  const halfWidthM = (frame.widthPx / 2 + marginPx) * frame.resolution;
  const halfHeightM = (frame.heightPx / 2 + marginPx) * frame.resolution;
  const [x, y] = frame.centreLevel;
  return [x - halfWidthM, y - halfHeightM, x + halfWidthM, y + halfHeightM];
}
