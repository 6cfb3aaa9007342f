// The address bar's `#...`: which level, which part of it and which layers, so that a link shows a
// colleague the same picture. Also the way in for `#token=...`.

import { DEFAULT_LAYERS, LAYER_NAMES, type Layers } from "./layers";
import { EVIDENCE, type Evidence } from "./pyramid";

/** One level of one site. */
export interface Place {
  site: string;
  level: string;
}

/** Which part of the level is shown: all of it, however it grows, or a fixed part. */
export type View =
  | { kind: "fit" }
  | { kind: "at"; xLevelM: number; yLevelM: number; resolution: number };

/** What a link says. */
export interface Permalink {
  place: Place | null;
  view: View;
  layers: Layers;
  evidence: Evidence;
}

function finite(text: string | null): number | null {
  if (text === null || text.trim() === "") return null;
  const value = Number(text);
  return Number.isFinite(value) ? value : null;
}

/** What a hash says; whatever is missing or not understood is as if it were not there. */
export function parsePermalink(hash: string): Permalink {
  const fields = new URLSearchParams(hash.replace(/^#/, ""));
  const site = fields.get("site");
  const level = fields.get("level");
  const x = finite(fields.get("x"));
  const y = finite(fields.get("y"));
  const resolution = finite(fields.get("resolution"));
  const listed = fields.get("layers");
  const evidence = fields.get("evidence");
  return {
    place: site !== null && level !== null ? { site, level } : null,
    view:
      x !== null && y !== null && resolution !== null && resolution > 0
        ? { kind: "at", xLevelM: x, yLevelM: y, resolution }
        : { kind: "fit" },
    layers: listed === null ? DEFAULT_LAYERS : parseLayers(listed),
    evidence: EVIDENCE.find((known) => known === evidence) ?? "all",
  };
}

function parseLayers(text: string): Layers {
  const opacityOf = new Map<string, number>();
  for (const item of text.split(",")) {
    const [name = "", percent] = item.split(":");
    const value = percent === undefined ? null : finite(percent);
    opacityOf.set(name, value === null ? 1 : Math.min(1, Math.max(0, value / 100)));
  }
  const layers = { ...DEFAULT_LAYERS };
  for (const name of LAYER_NAMES) {
    const opacity = opacityOf.get(name);
    layers[name] = opacity === undefined ? { ...layers[name], on: false } : { on: true, opacity };
  }
  return layers;
}

function formatLayers(layers: Layers): string {
  return LAYER_NAMES.filter((name) => layers[name].on)
    .map((name) => {
      const percent = Math.round(layers[name].opacity * 100);
      return percent === 100 ? name : `${name}:${percent}`;
    })
    .join(",");
}

/** The hash, with `#`, that says the same. */
export function formatPermalink(link: Permalink): string {
  const fields: string[] = [];
  if (link.place !== null) {
    fields.push(`site=${encodeURIComponent(link.place.site)}`, `level=${encodeURIComponent(link.place.level)}`);
  }
  if (link.view.kind === "at") {
    fields.push(
      `x=${link.view.xLevelM.toFixed(2)}`,
      `y=${link.view.yLevelM.toFixed(2)}`,
      `resolution=${Number(link.view.resolution.toPrecision(4))}`,
    );
  }
  fields.push(`layers=${formatLayers(link.layers)}`);
  if (link.evidence !== "all") fields.push(`evidence=${link.evidence}`);
  return `#${fields.join("&")}`;
}

/** The token in a hash, if there is one, and the hash without it. */
export function takeToken(hash: string): { token: string | null; rest: string } {
  const fields = hash.replace(/^#/, "").split("&").filter((field) => field !== "");
  const rest = fields.filter((field) => !field.startsWith("token="));
  const token = new URLSearchParams(fields.find((field) => field.startsWith("token="))).get("token");
  return { token: token === "" ? null : token, rest: rest.length === 0 ? "" : `#${rest.join("&")}` };
}
