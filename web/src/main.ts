// Puts the page together: state, requests, map and panels. The only place that knows them all, and
// the only one that reads the clock.

import { createAlignmentActions } from "./aligning";
import { createApi } from "./api";
import { setShown } from "./dom";
import { createChangeActions } from "./changing";
import { createDraftActions } from "./drafting";
import { createEditActions } from "./editing/acting";
import { commanded } from "./editing/commands";
import { commandOf } from "./editing/keys";
import { createWindowMemory, locksOf } from "./editing/windows";
import { createFacts } from "./facts";
import { followLevel } from "./feed";
import { createImportActions } from "./importing";
import { createMapView } from "./map/view";
import { followModel, type ModelFollower } from "./modelling";
import { DARK, LIGHT, type Theme } from "./palette";
import { createAlignmentsCard } from "./panels/alignments_card";
import { createChangesCard } from "./panels/changes_card";
import { createContributionsCard } from "./panels/contributions_card";
import { createEditBar } from "./panels/edit_bar";
import { createEditCard } from "./panels/edit_card";
import { createFilesCard } from "./panels/files_card";
import { createHeader } from "./panels/header";
import { createLayersCard } from "./panels/layers_card";
import { createLevelCard } from "./panels/level_card";
import { createLogPanel } from "./panels/log_panel";
import { createMapTools, ZOOM_STEP } from "./panels/map_tools";
import { createMessages } from "./panels/messages";
import { createModelCard } from "./panels/model_card";
import { createPriorCard } from "./panels/prior_card";
import { createRobotsCard } from "./panels/robots_card";
import { createSelectionCard } from "./panels/selection_card";
import { createSpacePanel } from "./panels/space_panel";
import { createSignIn } from "./panels/sign_in";
import { formatPermalink, parsePermalink, takeToken } from "./permalink";
import { pick } from "./pick";
import { createLogActions } from "./reverting";
import { resume, signIn, signOut } from "./session";
import { initialState, samePlace } from "./state";
import { createStore } from "./store";
import { createFileActions } from "./taking";
import { uuidFrom } from "./uuid";

/** How often the ages on the page are brought up to date. */
const TICK_MS = 5_000;

function byId(id: string): HTMLElement {
  const element = document.getElementById(id);
  if (element === null) throw new Error(`the page has no #${id}`);
  return element;
}

const timers = {
  setTimeout: (run: () => void, delayMs: number) => window.setTimeout(run, delayMs),
  clearTimeout: (timer: number) => {
    window.clearTimeout(timer);
  },
};
const uuid = (): string => uuidFrom(crypto.getRandomValues(new Uint8Array(16)));
const api = createApi({ fetch: window.fetch.bind(window), nowMs: () => Date.now() });

// A token in the address must not stay there: it would end up in bookmarks and in other people's hands.
const { token, rest } = takeToken(window.location.hash);
if (token !== null) history.replaceState(null, "", window.location.pathname + window.location.search + rest);

const store = createStore(initialState(parsePermalink(rest), api.nowMs()), (draw) => {
  window.requestAnimationFrame(draw);
});
const { dispatch } = store;

const darkScheme = window.matchMedia("(prefers-color-scheme: dark)");
const theme = (): Theme => (darkScheme.matches ? DARK : LIGHT);

// The map.
const stage = byId("map");
const facts = createFacts(document.documentElement);
const map = createMapView({
  target: stage,
  store,
  api,
  theme,
  timers,
  uuid,
  onPainted: facts.painted,
});

// The panels.
const page = byId("page");
const panels = byId("panels");
const overMap = byId("over-map");
const log = createLogActions({ api, state: store.state, dispatch, uuid });
const prior = createImportActions({ api, state: store.state, dispatch });
const draft = createDraftActions({ api, state: store.state, dispatch });
const takenIn = createFileActions({
  api,
  state: store.state,
  dispatch,
  onTaken: () => {
    model?.look();
    draft.refresh();
  },
});
const changes = createChangeActions({ api, state: store.state, dispatch, timers });
const alignments = createAlignmentActions({ api, state: store.state, dispatch, timers });
const memory = createWindowMemory({ shared: window.localStorage, own: window.sessionStorage, locks: locksOf((navigator as Partial<Navigator>).locks), newId: uuid });
const edit = createEditActions({ api, state: store.state, dispatch, memory, timers, uuid });
// What a closed window has left is found once it is known which ones live.
void memory.ready.then(() => {
  if (!store.state().editing.on) edit.arrived();
});
const draws = [
  createHeader({ parent: byId("header"), store, onSignOut: () => void signOut(api, dispatch) }),
  createLevelCard(panels),
  createRobotsCard(panels, { store, theme }),
  createLayersCard(panels, store),
  createModelCard(panels, { store, actions: draft }),
  createFilesCard(panels, takenIn),
  createChangesCard(panels, { store, actions: changes }),
  createAlignmentsCard(panels, { store, actions: alignments }),
  createPriorCard(panels, prior),
  createContributionsCard(panels, { store, theme, onOpenLog: log.open }),
  createLogPanel({ parent: page, store, theme, actions: log }),
  createSelectionCard(overMap, store),
  createSpacePanel({ parent: overMap, store, actions: edit, theme, onShown: facts.space }),
  createEditCard(panels, { store, actions: edit }),
  createEditBar({ parent: overMap, store, actions: edit, hand: { uuid } }),
  createMapTools({ parent: overMap, store, onZoom: map.zoomBy, edit }),
  createMessages(overMap, window.location.origin),
  createSignIn({
    parent: byId("screen"),
    onSignIn: (value) => void signIn(api, dispatch, value),
    onRetry: () => void resume(api, dispatch),
  }),
  map.draw,
  facts.drawn,
];
store.onFrame((state) => {
  setShown(page, state.session.kind === "in");
  page.classList.toggle("panels-open", state.panelsOpen);
  page.classList.toggle("log-open", state.log.open);
  page.classList.toggle("edit-on", state.editing.on);
  stage.classList.toggle("drawing", state.editing.on && state.editing.tool !== "select");
  for (const draw of draws) draw(state);
});
darkScheme.addEventListener("change", () => {
  dispatch({ kind: "tick", nowMs: api.nowMs() });
});

// Acting on changes: following the chosen level, and keeping the address bar up to date.
let unfollow: (() => void) | null = null;
let model: ModelFollower | null = null;
store.onChange((state, before) => {
  const follows = state.session.kind === "in" && state.sites !== null ? state.place : null;
  const followed = before.session.kind === "in" && before.sites !== null ? before.place : null;
  if (!samePlace(follows, followed)) {
    unfollow?.();
    unfollow =
      follows === null
        ? null
        : followLevel({
            place: follows,
            api,
            state: store.state,
            dispatch,
            openEvents: (path) => new EventSource(path),
            timers,
          });
    model?.stop();
    model = follows === null ? null : followModel({ place: follows, api, state: store.state, dispatch, timers });
    if (follows !== null) edit.arrived();
  }
});
store.onChange((state, before) => {
  if (state.log.open && before.contributions !== state.contributions) log.refresh();
  const isAnotherModel = before.model.view !== state.model.view || before.level?.revision !== state.level?.revision;
  if (isAnotherModel || before.layers !== state.layers) model?.look();
  // What follows the model has just found that it is another.
  if (before.model.revision !== state.model.revision) {
    draft.refresh();
    edit.refresh();
  }
  const isAnotherHeight = before.model.view.heightM !== state.model.view.heightM;
  if (isAnotherHeight || before.level?.revision !== state.level?.revision) changes.refresh();
  if (before.level?.revision !== state.level?.revision) alignments.refresh();
  const { copy, clashes } = state.editing;
  if (copy !== null && (copy !== before.editing.copy || clashes !== before.editing.clashes)) edit.changed();
  if (state.imports.open && before.level !== state.level) prior.refresh();
});
store.onChange((state) => {
  if (state.session.kind !== "in" || state.place === null) return;
  const hash = formatPermalink(state);
  if (hash !== window.location.hash) history.replaceState(null, "", hash);
});
window.addEventListener("hashchange", () => {
  const hash = takeToken(window.location.hash);
  if (hash.token !== null) void signIn(api, dispatch, hash.token);
  dispatch({ kind: "permalink", link: parsePermalink(hash.rest) });
});

// Keys of the editor, before those of the map.
document.addEventListener(
  "keydown",
  (event) => {
    const { editing } = store.state();
    const field = event.target instanceof Element ? event.target.closest("input, select, textarea") : null;
    const { key, shiftKey: shift, altKey: alt } = event;
    const command = commandOf({ key, shift, alt, ctrl: event.ctrlKey || event.metaKey }, editing);
    // Who types means the text; only sending is meant from everywhere.
    if (command === null || (field !== null && command !== "send")) return;
    if (command === "type-length") {
      // Digits mean other things elsewhere.
      event.stopPropagation();
      document.getElementById("edit-length")?.focus();
      return;
    }
    event.preventDefault();
    event.stopPropagation();
    if (command === "send") edit.send();
    else edit.change(commanded(editing, command, { uuid }, shift));
  },
  { capture: true },
);

// Keys, while nobody types.
document.addEventListener("keydown", (event) => {
  const typing = event.target instanceof Element && event.target.closest("input, select, textarea") !== null;
  if ((typing && event.key !== "Escape") || event.ctrlKey || event.metaKey || event.altKey) return;
  const state = store.state();
  switch (event.key) {
    case "f":
      dispatch({ kind: "view", view: { kind: "fit" } });
      break;
    case "g":
      dispatch({ kind: "layer", name: "grid", setting: { on: !state.layers.grid.on } });
      break;
    case "e":
      edit.start();
      break;
    case "3":
      edit.turnSpace();
      break;
    case "+":
    case "-":
      // Over the map OpenLayers sees to it.
      if (document.activeElement !== stage) map.zoomBy(event.key === "+" ? ZOOM_STEP : 1 / ZOOM_STEP);
      break;
    case "Escape":
      if (state.log.open) log.close();
      else dispatch({ kind: "select", selection: null });
      break;
    case "Enter":
      if (document.activeElement === stage) {
        dispatch({ kind: "select", selection: pick(state, map.centre(), state.shownResolution) });
      }
      break;
  }
});

window.setInterval(() => {
  dispatch({ kind: "tick", nowMs: api.nowMs() });
}, TICK_MS);

void (token === null ? resume(api, dispatch) : signIn(api, dispatch, token));
