// The loop: an event changes the state, those who act on changes act, and the page is drawn once a
// frame from the newest state.

import { update, type Event, type State } from "./state";

export type Dispatch = (event: Event) => void;

export interface Store {
  state: () => State;
  dispatch: Dispatch;
  /** Calls `act` after each event that changed something, with the state before it. */
  onChange: (act: (state: State, before: State) => void) => void;
  /** Calls `draw` at most once a frame. */
  onFrame: (draw: (state: State) => void) => void;
}

/** A loop that starts at `initial`; `nextFrame` is the window's `requestAnimationFrame`. */
export function createStore(initial: State, nextFrame: (draw: () => void) => void): Store {
  let state = initial;
  let framePending = false;
  const actors: ((state: State, before: State) => void)[] = [];
  const drawers: ((state: State) => void)[] = [];

  const frame = (): void => {
    if (framePending) return;
    framePending = true;
    nextFrame(() => {
      framePending = false;
      for (const draw of drawers) draw(state);
    });
  };

  return {
    state: () => state,
    dispatch(event) {
      const before = state;
      state = update(state, event);
      if (state === before) return;
      const after = state;
      for (const act of actors) act(after, before);
      frame();
    },
    onChange(act) {
      actors.push(act);
    },
    onFrame(draw) {
      drawers.push(draw);
      frame();
    },
  };
}
