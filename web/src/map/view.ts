// The map: OpenLayers in a local metric projection, with a painted canvas per layer. Reads the
// state, and tells by events what the operator does with the map.

import Map from "ol/Map.js";
import View from "ol/View.js";
import { defaults as defaultInteractions } from "ol/interaction/defaults.js";
import type Layer from "ol/layer/Layer.js";
import Projection from "ol/proj/Projection.js";
import type { Api } from "../api";
import type { Timers } from "../coalesce";
import { boundsOf } from "../content";
import { unsent } from "../editing/history";
import { holds, shareOf, union, widened, type Box, type Point } from "../geometry";
import { LAYER_NAMES, type LayerName } from "../layers";
import { memo } from "../memo";
import { boundsOfPlan } from "../model";
import type { Theme } from "../palette";
import { pick } from "../pick";
import { pictureMarks, type PictureMark } from "../pyramid";
import { isSilent, robotsHere, samePlace, tileEdgeM, type State } from "../state";
import type { Store } from "../store";
import { batchesOf } from "./batches";
import type { Frame } from "./frame";
import { createGestures } from "./gestures";
import { paintChains } from "./paint_chains";
import { paintChanges } from "./paint_changes";
import { paintClusters } from "./paint_clusters";
import { paintEditing } from "./paint_editing";
import { paintFixes } from "./paint_fixes";
import { paintGrid } from "./paint_grid";
import { paintLandmarks } from "./paint_landmarks";
import { paintModel } from "./paint_model";
import { paintPreview } from "./paint_preview";
import { paintRaster } from "./paint_raster";
import { paintRobots } from "./paint_robots";
import { paintSegments } from "./paint_segments";
import { paintSelection } from "./paint_selection";
import { createPainterLayer } from "./painter_layer";
import { createPictures } from "./pictures";

/** Metres per pixel, from a wall's roughness to a whole plant. */
const FINEST = 0.001;
const COARSEST = 20;
/** Space kept free around a level that is shown whole. */
const FIT_PADDING_PX = [28, 28, 56, 28];
/** A level that is shown whole shows at least this much. */
const FIT_LEAST_M = 6;
/** A growing level gets this share of itself more room than it needs ... */
const FIT_GROWTH = 0.12;
/** ... and is shown larger when it fills less than this share of the map. */
const FIT_SHARE_LEAST = 0.6;
const ZOOM_MS = 180;

export interface MapView {
  draw: (state: State) => void;
  zoomBy: (factor: number) => void;
  /** The level's point in the middle of the map. */
  centre: () => Point;
}

/** What has been painted. */
export interface Painted {
  /** Straight pieces of segments on the screen. */
  piecesPainted: number;
  /** Pictures of the raster that are loaded, and those on the screen that are missing or stale. */
  picturesLoaded: number;
  picturesPending: number;
}

export interface MapViewOptions {
  target: HTMLElement;
  store: Store;
  api: Api;
  theme: () => Theme;
  timers: Timers;
  uuid: () => string;
  /** The map was painted, from this state. */
  onPainted: (state: State, painted: Painted) => void;
}

export function createMapView(options: MapViewOptions): MapView {
  const { target, store, api, theme } = options;
  let state = store.state();
  let piecesPainted = 0;

  const pictures = createPictures<ImageBitmap>({
    load: async (address) => {
      if (state.place === null) return null;
      const blob = await api.picture(state.place, address, state.evidence);
      return blob === null ? null : await createImageBitmap(blob);
    },
    discard: (picture) => {
      picture.close();
    },
    onLoaded: () => {
      layers.raster.changed();
    },
    timers: options.timers,
  });

  const marksAt = memo((tiles: State["content"]["tiles"], evidence: State["evidence"], tileCells: number) => {
    const byZ: Record<number, ReadonlyMap<string, PictureMark>> = {};
    return (z: number) => (byZ[z] ??= pictureMarks(tiles.values(), { z, evidence, tileCells }));
  });
  const batches = memo((segments: State["content"]["segments"], slots: State["slots"]) =>
    batchesOf(segments.values(), slots),
  );
  const bounds = memo(boundsOf);
  const planBounds = memo(boundsOfPlan);
  const marked = memo((copy: State["editing"]["copy"], clashes: State["editing"]["clashes"]) => ({
    unsent: copy === null ? new globalThis.Map<string, unknown>() : unsent(copy),
    clashing: new Set(clashes.map(({ id }) => id)),
  }));

  const painters: Record<LayerName, (frame: Frame) => void> = {
    raster: (frame) => {
      if (state.level === null) return;
      const { resolution_m: cellM, tile_cells: tileCells } = state.level;
      const marks = marksAt(state.content.tiles, state.evidence, tileCells);
      paintRaster(frame, { pictures, marks, cellM, epoch: state.content.epoch });
    },
    grid: (frame) => {
      paintGrid(frame, theme());
    },
    model: (frame) => {
      // The draft that is being edited is painted in its place.
      if (state.model.plan !== null && !state.editing.on) paintModel(frame, state.model.plan, theme());
    },
    landmarks: (frame) => {
      paintLandmarks(frame, state.model.landmarks.values(), theme());
    },
    clusters: (frame) => {
      paintClusters(frame, state.content.clusters.values(), { slots: state.slots, theme: theme() });
    },
    chains: (frame) => {
      paintChains(frame, state.content.chains.values(), theme());
    },
    segments: (frame) => {
      piecesPainted = paintSegments(frame, batches(state.content.segments, state.slots), theme());
    },
    robots: (frame) => {
      paintFixes(frame, state, theme());
      const marks = robotsHere(state).map((robot) => ({
        robot,
        slot: state.slots.get(robot.robot) ?? 0,
        silent: isSilent(state, robot.robot),
      }));
      paintRobots(frame, marks, theme());
    },
  };
  const layers = Object.fromEntries(
    LAYER_NAMES.map((name) => [name, createPainterLayer(name, painters[name])]),
  ) as Record<LayerName, Layer>;
  const selectionLayer = createPainterLayer("selection", (frame) => {
    if (state.changes.open) paintChanges(frame, state.changes.list ?? [], theme());
    paintSelection(frame, state, theme());
    paintPreview(frame, state, theme());
  });
  const editingLayer = createPainterLayer("editing", (frame) => {
    const { editing } = state;
    if (editing.on) paintEditing(frame, editing, marked(editing.copy, editing.clashes), theme());
  });

  const projection = new Projection({ code: "mapfold:level", units: "m", metersPerUnit: 1, axisOrientation: "enu" });
  const view = new View({
    projection,
    center: [0, 0],
    resolution: 0.05,
    minResolution: FINEST,
    maxResolution: COARSEST,
    enableRotation: false,
    smoothResolutionConstraint: false,
  });
  const map = new Map({
    target,
    view,
    controls: [],
    interactions: defaultInteractions({ altShiftDragRotate: false, pinchRotate: false }),
    layers: [
      layers.raster,
      layers.grid,
      layers.model,
      layers.clusters,
      layers.chains,
      selectionLayer,
      layers.segments,
      editingLayer,
      layers.landmarks,
      layers.robots,
    ],
  });

  const gestures = createGestures({
    editing: () => store.state().editing,
    change: (editing) => {
      store.dispatch({ kind: "editing", editing });
    },
    resolution: () => resolution(),
    hand: { uuid: options.uuid },
  });
  for (const interaction of gestures.interactions) map.addInteraction(interaction);

  /** What the page itself has last set; anything else is the operator's doing. */
  let applied: { centre: Point; resolution: number } | null = null;
  let fitted: Box | null = null;
  /** The state's view that the map has taken over, or that came from it. */
  let drawnView: State["view"] | null = null;

  const centre = (): Point => {
    const [x = 0, y = 0] = view.getCenter() ?? [];
    return [x, y];
  };
  const resolution = (): number => view.getResolution() ?? 1;
  const isApplied = (): boolean => {
    const [x, y] = centre();
    const close = resolution() * 0.01;
    return (
      applied !== null &&
      Math.abs(applied.centre[0] - x) < close &&
      Math.abs(applied.centre[1] - y) < close &&
      Math.abs(applied.resolution / resolution() - 1) < 1e-3
    );
  };
  const remember = (): void => {
    applied = { centre: centre(), resolution: resolution() };
  };

  remember();
  store.dispatch({ kind: "shown", resolution: resolution() });

  const fit = (): void => {
    const tileM = tileEdgeM(state.level);
    let box = tileM === null ? null : bounds(state.content, tileM);
    const planned = state.layers.model.on ? planBounds(state.model.plan) : null;
    if (planned !== null) box = union(box, planned);
    for (const { last_pose: pose } of robotsHere(state)) {
      box = union(box, [pose.x_m, pose.y_m, pose.x_m, pose.y_m]);
    }
    if (box === null || view.getInteracting() || view.getAnimating()) return;
    const [width = 0, height = 0] = map.getSize() ?? [];
    if (width === 0 || height === 0) return;
    const shown = view.calculateExtent([width, height]) as [number, number, number, number];
    // While a level grows, the picture stays as it is until the level outgrows it.
    if (fitted !== null && holds(shown, box) && shareOf(shown, box) > FIT_SHARE_LEAST) return;
    const room = widened(box, { leastM: FIT_LEAST_M, share: fitted === null ? 0 : FIT_GROWTH });
    view.fit([...room], { size: [width, height], padding: FIT_PADDING_PX });
    fitted = box;
    remember();
  };

  const drawView = (): void => {
    const asked = state.view !== drawnView;
    drawnView = state.view;
    if (asked) {
      fitted = null;
      view.cancelAnimations();
    }
    if (state.view.kind === "fit") {
      fit();
      return;
    }
    if (!asked) return;
    const { xLevelM, yLevelM, resolution: wanted } = state.view;
    applied = { centre: [xLevelM, yLevelM], resolution: wanted };
    if (isApplied()) return;
    view.setCenter([xLevelM, yLevelM]);
    view.setResolution(wanted);
    remember();
  };

  /** Tells where the operator has moved the map, unless another view was asked for meanwhile. */
  const tellMoved = (): void => {
    if (state.place === null || store.state().view !== drawnView) return;
    const [xLevelM, yLevelM] = centre();
    remember();
    drawnView = { kind: "at", xLevelM, yLevelM, resolution: resolution() };
    store.dispatch({ kind: "view", view: drawnView });
  };
  // The page itself moves the map at once; only what the operator does is an interaction or an
  // animation. Its first step ends the following of the level: a refit would undo it.
  const leaveFit = (): void => {
    if (drawnView?.kind === "fit" && (view.getInteracting() || view.getAnimating())) tellMoved();
  };

  view.on("change:center", leaveFit);
  view.on("change:resolution", () => {
    leaveFit();
    store.dispatch({ kind: "shown", resolution: resolution() });
  });
  map.on("change:size", () => {
    fitted = null;
    if (state.view.kind === "fit") fit();
  });
  map.on("moveend", () => {
    if (!isApplied()) tellMoved();
  });
  map.on("pointermove", (event) => {
    const { coordinate, dragging } = event;
    const [x = 0, y = 0] = coordinate;
    store.dispatch({ kind: "pointer", at: [x, y] });
    if (!gestures.move(event) && !dragging) target.classList.toggle("over-something", pick(state, [x, y], resolution()) !== null);
  });
  target.addEventListener("pointerleave", () => {
    store.dispatch({ kind: "pointer", at: null });
    gestures.leave();
  });
  map.on("click", (event) => {
    const [x = 0, y = 0] = event.coordinate;
    if (!gestures.click(event)) store.dispatch({ kind: "select", selection: pick(state, [x, y], resolution()) });
  });
  map.on("postrender", () => {
    const { loaded, pending } = pictures.counts();
    options.onPainted(state, { piecesPainted, picturesLoaded: loaded, picturesPending: pending });
  });

  return {
    draw(now) {
      const before = state;
      state = now;
      if (now === before) return;
      if (!samePlace(before.place, now.place) || before.evidence !== now.evidence) pictures.clear();
      for (const name of LAYER_NAMES) {
        layers[name].setVisible(now.layers[name].on);
        layers[name].setOpacity(now.layers[name].opacity);
      }
      drawView();
      if (drawnFrom(before).some((value, index) => value !== drawnFrom(now)[index])) map.render();
    },
    zoomBy(factor) {
      view.animate({ resolution: resolution() / factor, duration: ZOOM_MS });
    },
    centre,
  };
}

/** What of the state the layers are painted from. */
function drawnFrom(state: State): readonly unknown[] {
  return [
    state.content,
    state.robots,
    state.heardAtMs,
    state.slots,
    state.selection,
    state.log.preview,
    state.evidence,
    state.level,
    state.model,
    state.changes,
    state.editing,
    state.nowMs,
  ];
}
