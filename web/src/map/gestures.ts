// The pointer over the map while the model is edited: what OpenLayers tells goes to the tools first; what they do not
// want moves the map.

import type MapBrowserEvent from "ol/MapBrowserEvent.js";
import Interaction from "ol/interaction/Interaction.js";
import PointerInteraction from "ol/interaction/Pointer.js";
import type { EditingState } from "../editing";
import { clicked, dragged, grasped, hovered, left, released, type Hand, type Pointer } from "../editing/pointing";

export interface Gestures {
  interactions: Interaction[];
  /** Whether the tools have taken a click. */
  click: (event: MapBrowserEvent) => boolean;
  /** Whether the tools have taken a movement. */
  move: (event: MapBrowserEvent) => boolean;
  leave: () => void;
}

export interface GesturesOptions {
  editing: () => EditingState;
  change: (editing: Partial<EditingState>) => void;
  resolution: () => number;
  hand: Hand;
}

export function createGestures({ editing, change, resolution, hand }: GesturesOptions): Gestures {
  const pointer = ({ coordinate, originalEvent }: MapBrowserEvent): Pointer => {
    const [x = 0, y = 0] = coordinate;
    const { shiftKey: several, altKey: loose } = originalEvent as PointerEvent;
    return { at: [x, y], resolution: resolution(), isTouch: (originalEvent as PointerEvent).pointerType === "touch", several, loose };
  };
  const isOn = (): boolean => editing().on && editing().copy !== null;

  const grasping = new PointerInteraction({
    handleDownEvent: (event) => {
      const { originalEvent } = event;
      if (!isOn() || (originalEvent as PointerEvent).button !== 0) return false;
      const next = grasped(editing(), pointer(event));
      if (next !== null) change(next);
      return next !== null;
    },
    handleDragEvent: (event) => {
      change(dragged(editing(), pointer(event)));
    },
    handleUpEvent: () => {
      change(released(editing()));
      return false;
    },
  });
  // Two quick places of a wall are no wish to be nearer.
  const clicksAreClicks = new Interaction({ handleEvent: ({ type }) => !(isOn() && type === "dblclick") });

  return {
    interactions: [grasping, clicksAreClicks],
    click: (event) => {
      if (!isOn()) return false;
      change(clicked(editing(), pointer(event), hand));
      return true;
    },
    move: (event) => {
      if (!isOn()) return false;
      if (!event.dragging) change(hovered(editing(), pointer(event)));
      return true;
    },
    leave: () => {
      if (isOn()) change(left(editing()));
    },
  };
}
