// Walls, doorways and working copies for tests of editing.

import { NO_EDITING, type EditingState } from "../src/editing";
import { doorwayIn } from "../src/editing/doorways";
import { workingCopy, type WorkingCopy } from "../src/editing/history";
import type { Objects } from "../src/editing/objects";
import type { Hand, Pointer } from "../src/editing/pointing";
import { wallObject, wallOf, type Wall } from "../src/editing/walls";
import type { Point } from "../src/geometry";
import type { GdbObject, GdbPrototype } from "../src/wire";

export function wall(a: Point, b: Point, fields: Partial<Wall> = {}): Wall {
  return { a, b, thicknessM: 0.1, lowerM: 0, upperM: 2.5, ...fields };
}

export function doorway(at: GdbObject, alongM: number): GdbObject {
  return doorwayIn(asWall(at), alongM, { widthM: 0.9, heightM: 2.1 });
}

export function asWall(object: GdbObject | null | undefined): Wall {
  const found = object == null ? null : wallOf(object);
  if (found === null) throw new Error("this is no wall");
  return found;
}

/** Two walls that meet at a right angle, with a doorway in the first, and a table beside them. */
export function corner(): Map<string, GdbObject> {
  const east = wallObject(wall([0, 0], [4, 0]));
  return new Map<string, GdbObject>([
    ["east", east],
    ["north", wallObject(wall([4, 0], [4, 3]))],
    ["door", doorway(east, 2)],
    ["table", { kind: "furniture", prototype: "table", placement: { position_m: [1, 2, 0] } }],
  ]);
}

export const TABLE: GdbPrototype = { kind: "furniture", solids: [{ box: { from_m: [-0.8, -0.4, 0.7], to_m: [0.8, 0.4, 0.75] } }] };

export function copyOf(objects: Objects): WorkingCopy {
  return workingCopy(objects, { draft: 5, library: 1 });
}

export function editing(objects: Objects, fields: Partial<EditingState> = {}): EditingState {
  return { ...NO_EDITING, on: true, copy: copyOf(objects), library: new Map([["table", TABLE]]), ...fields };
}

/** Identities one after the other. */
export function counting(prefix = "new"): Hand {
  let count = 0;
  return { uuid: () => `${prefix}-${++count}` };
}

/** A mouse at 1 cm per pixel: what is within 10 cm is near. */
export function mouse(at: Point, fields: Partial<Pointer> = {}): Pointer {
  return { at, resolution: 0.01, isTouch: false, several: false, loose: false, ...fields };
}
