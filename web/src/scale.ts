// Round lengths for the scale bar and the grid: 1, 2 or 5 times a power of ten metres.

/** The greatest round length of at most `mostM` metres. */
export function roundLengthBelow(mostM: number): number {
  const power = 10 ** Math.floor(Math.log10(mostM));
  const leading = mostM / power;
  // The slack forgives mostM = 4.999999 where 5 was meant.
  return (leading >= 5 - 1e-9 ? 5 : leading >= 2 - 1e-9 ? 2 : 1) * power;
}

/** The least round length of at least `leastM` metres. */
export function roundLengthAbove(leastM: number): number {
  const power = 10 ** Math.floor(Math.log10(leastM));
  const leading = leastM / power;
  return (leading <= 1 + 1e-9 ? 1 : leading <= 2 + 1e-9 ? 2 : leading <= 5 + 1e-9 ? 5 : 10) * power;
}

/** A scale bar: what it stands for and how long it is on the screen. */
export interface ScaleBar {
  lengthM: number;
  lengthPx: number;
}

/** The longest round scale bar of at most `mostPx` pixels at `resolution` metres per pixel. */
export function scaleBar(resolution: number, mostPx: number): ScaleBar {
  const lengthM = roundLengthBelow(resolution * mostPx);
  return { lengthM, lengthPx: lengthM / resolution };
}

/** Distance of grid lines so that they stand at least `leastPx` pixels apart. */
export function gridStep(resolution: number, leastPx: number): number {
  return roundLengthAbove(resolution * leastPx);
}
