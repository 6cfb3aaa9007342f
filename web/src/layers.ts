// The layers of the map, from below to above.

/** Names of layers, as in permalinks. */
export const LAYER_NAMES = ["raster", "grid", "model", "clusters", "chains", "segments", "landmarks", "robots"] as const;

export type LayerName = (typeof LAYER_NAMES)[number];

/** Whether a layer is shown, and how strongly (0 to 1). */
export interface LayerSetting {
  on: boolean;
  opacity: number;
}

export type Layers = Readonly<Record<LayerName, LayerSetting>>;

/** What is shown when a link does not say. */
export const DEFAULT_LAYERS: Layers = {
  raster: { on: true, opacity: 1 },
  grid: { on: false, opacity: 1 },
  model: { on: true, opacity: 1 },
  clusters: { on: true, opacity: 1 },
  chains: { on: true, opacity: 1 },
  segments: { on: true, opacity: 1 },
  landmarks: { on: false, opacity: 1 },
  robots: { on: true, opacity: 1 },
};

/** What a layer is called. */
export const LAYER_TITLES: Readonly<Record<LayerName, string>> = {
  raster: "Occupancy",
  grid: "Grid",
  model: "Model (as planned)",
  clusters: "Clusters",
  chains: "Chains",
  segments: "Segments",
  landmarks: "Landmarks",
  robots: "Robots",
};
