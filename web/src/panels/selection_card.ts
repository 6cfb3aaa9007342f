// What the operator has chosen on the map, in figures.

import { competenceInWords } from "../competence";
import { angleSd, areaOf, edgesOf, ellipse95, leastExistence, lengthOf, middleOf, offsetSd } from "../geometry";
import { el, setShown, setText } from "../dom";
import { LANDMARK_WORDS } from "../model";
import { fixHere, isSilent, type State } from "../state";
import type { Store } from "../store";
import type { Chain, Cluster, EndKind, Landmark, RobotDescription, RobotFix, Segment } from "../wire";
import { ago, coordinate, count, counted, degrees, fixed, instant, lengthInWords, likelihood, listed } from "../words";

/** A card's title and its lines. */
export interface Description {
  title: string;
  lines: readonly (readonly [name: string, value: string])[];
}

const END_WORDS: Readonly<Record<EndKind, string>> = {
  corner: "corner",
  jump: "free end",
  occluded: "out of view",
};

/** What is chosen, in words; null if nothing is. */
export function describe(state: State): Description | null {
  const { selection, content } = state;
  if (selection === null) return null;
  switch (selection.kind) {
    case "segment": {
      const segment = content.segments.get(selection.id);
      return segment === undefined ? null : describeSegment(segment, state);
    }
    case "cluster": {
      const cluster = content.clusters.get(selection.id);
      return cluster === undefined ? null : describeCluster(cluster, state);
    }
    case "chain": {
      const chain = content.chains.get(selection.id);
      return chain === undefined ? null : describeChain(chain, state);
    }
    case "landmark": {
      const landmark = state.model.landmarks.get(selection.id);
      return landmark === undefined ? null : describeLandmark(landmark, state);
    }
    case "robot": {
      const robot = state.robots.find((one) => one.robot === selection.id);
      return robot === undefined ? null : describeRobot(robot, state);
    }
  }
}

function names(slugs: readonly string[], state: State): string {
  return listed(slugs.map((slug) => state.robots.find((robot) => robot.robot === slug)?.name ?? slug));
}

function describeSegment(segment: Segment, state: State): Description {
  const middle = middleOf(segment);
  const sd = offsetSd(segment.covariance, middle);
  const shared = offsetSd(segment.covariance_dependent, middle);
  const first = segment.solid.at(0)?.ends[0];
  const last = segment.solid.at(-1)?.ends[1];
  return {
    title: "Segment",
    lines: [
      ["Quality", counted(segment.quality, "look")],
      ["Is there", `${likelihood(leastExistence(segment))} or more`],
      ["Seen by", names(segment.robots, state)],
      ["Length", `${lengthInWords(lengthOf(segment))} in ${counted(segment.solid.length, "piece")}`],
      ["Offset sd", `${lengthInWords(sd)}, of it ${lengthInWords(shared)} shared`],
      ["Angle sd", degrees(angleSd(segment.covariance), 2)],
      ["Ends", first === undefined || last === undefined ? "–" : `${END_WORDS[first]}, ${END_WORDS[last]}`],
      ...chainsWith(segment.id, state).map((chain): [string, string] => ["Part of", chainInWords(chain)]),
      ["Line", `ρ ${coordinate(segment.rho_m)}, α ${degrees(segment.alpha_rad)}`],
      ["First seen", instant(segment.first_seen)],
      ["Last seen", instant(segment.last_seen)],
    ],
  };
}

const CHAIN_WORDS: Readonly<Record<Chain["kind"], string>> = {
  polyline: "polyline",
  obstacle: "obstacle",
  room: "room",
};

function chainInWords(chain: Chain): string {
  return `${CHAIN_WORDS[chain.kind]} of ${counted(chain.segments.length, "wall")}`;
}

function chainsWith(segment: string, state: State): Chain[] {
  return [...state.content.chains.values()].filter((chain) => chain.segments.includes(segment));
}

function describeChain(chain: Chain, state: State): Description {
  const length = edgesOf(chain).reduce((sum, [x0, y0, x1, y1]) => sum + Math.hypot(x1 - x0, y1 - y0), 0);
  const worst = Math.max(...chain.covariances.map(([[xx, xy], [, yy]]) => ellipse95(xx, xy, yy).majorM));
  return {
    title: chain.closed ? "Polygon" : "Polyline",
    lines: [
      ["What", `${chainInWords(chain)}${chain.closed ? `, ${AREA_WORDS[chain.kind]}` : ""}`],
      ["Quality", `at least ${counted(chain.quality, "look")} each`],
      ["Seen by", names(chain.robots, state)],
      ["Length", lengthInWords(length)],
      ...(chain.closed ? [["Area", `${fixed(areaOf(chain.vertices_m), 1)} m²`] as const] : []),
      ["Vertices", `${count(chain.vertices_m.length)}, 95 % within ${lengthInWords(worst)}`],
      ["First seen", instant(chain.first_seen)],
      ["Last seen", instant(chain.last_seen)],
    ],
  };
}

const AREA_WORDS: Readonly<Record<Chain["kind"], string>> = {
  polyline: "",
  obstacle: "free outside",
  room: "free inside",
};

function describeLandmark(landmark: Landmark, state: State): Description {
  const [x, y] = landmark.at_m;
  const [[xx, xy], [, yy], [, , hh]] = landmark.covariance;
  const { support } = landmark;
  const isCorner = landmark.kind === "convex_corner" || landmark.kind === "concave_corner";
  return {
    title: "Landmark",
    lines: [
      ["What", LANDMARK_WORDS[landmark.kind]],
      ["Known from", landmark.source === "gdb" ? "the published model" : "what robots saw"],
      ...(support == null ? [] : [["Quality", counted(support.looks, "look")] as const, ["Seen by", names(support.robots, state)] as const]),
      ["Position", `x ${coordinate(x)}, y ${coordinate(y)}`],
      ["Position", `95 % within ${lengthInWords(ellipse95(xx, xy, yy).majorM)}`],
      ["Opens to", `${degrees(landmark.heading_rad)}, sd ${degrees(Math.sqrt(hh), 2)}`],
      isCorner ? ["Free angle", degrees(landmark.extent)] : ["Width", lengthInWords(landmark.extent)],
    ],
  };
}

function describeCluster(cluster: Cluster, state: State): Description {
  const [[xx], [, yy]] = cluster.covariance;
  const [x, y] = cluster.centroid_m;
  return {
    title: "Cluster",
    lines: [
      ["Quality", counted(cluster.quality, "look")],
      ["Points", count(cluster.points)],
      ["Seen by", names(cluster.robots, state)],
      ["Centre", `x ${coordinate(x)}, y ${coordinate(y)}`],
      ["Centre sd", `x ${lengthInWords(Math.sqrt(xx))}, y ${lengthInWords(Math.sqrt(yy))}`],
      ["First seen", instant(cluster.first_seen)],
      ["Last seen", instant(cluster.last_seen)],
    ],
  };
}

function describeRobot(robot: RobotDescription, state: State): Description {
  const pose = robot.last_pose;
  const heardAtMs = state.heardAtMs.get(robot.robot);
  const heard = heardAtMs === undefined ? "not while this page is open" : ago(heardAtMs, state.nowMs);
  const lines: [string, string][] = [
    ["State", `${robot.state}, ${isSilent(state, robot.robot) ? "offline" : "online"}`],
    ["Last heard", heard],
    ["Competence", competenceInWords(robot)],
    ...robot.sensors.map((sensor): [string, string] => [
      "Sensor",
      `${sensor.model === undefined || sensor.model === "" ? sensor.kind : sensor.model}, up to ${lengthInWords(sensor.range_max_m)}${sensor.emulated ? ", emulated" : ""}`,
    ]),
    ["Contributions", count(robot.contributions)],
  ];
  if (pose != null) {
    const [[xx], [, yy], [, , hh]] = pose.covariance;
    lines.push(
      ["Position", `x ${coordinate(pose.x_m)}, y ${coordinate(pose.y_m)}`],
      ["Position sd", `x ${lengthInWords(Math.sqrt(xx))}, y ${lengthInWords(Math.sqrt(yy))}`],
      ["Heading", `${degrees(pose.heading_rad)}, sd ${degrees(Math.sqrt(hh), 2)}`],
      ["Seen at", `${instant(pose.observed_at)} by its clock`],
    );
  }
  const fix = fixHere(state, robot);
  if (fix !== null) lines.push(["Place", fixInWords(fix)]);
  if (robot.revision != null) lines.push(["Runs revision", count(robot.revision)]);
  if (robot.queue_length != null) lines.push(["Waiting to send", count(robot.queue_length)]);
  return { title: robot.name, lines };
}

/** What a robot knows of its place, in words. */
export function fixInWords(fix: RobotFix): string {
  const matched = [
    counted((fix.segments ?? []).length, "wall"),
    ...((fix.landmarks_m ?? []).length > 0 ? [counted((fix.landmarks_m ?? []).length, "landmark")] : []),
  ].join(" and ");
  switch (fix.kind) {
    case "unique":
      return "found just now, no other fits";
    case "tracked":
      return `tracked, last look matched with ${matched}`;
    case "ambiguous":
      return fix.places.length > 0
        ? `not sure: ${counted(fix.places.length, "place")} may be it`
        : "not sure: too many places may be it";
    case "no_match":
      return "lost: nothing on the map fits what it sees";
  }
}

export function createSelectionCard(parent: HTMLElement, store: Store): (state: State) => void {
  const title = el("h2");
  const lines = el("dl", { class: "lines" });
  const close = el("button", {
    class: "close",
    text: "×",
    attrs: { type: "button", "aria-label": "Close", title: "Close (Esc)" },
    on: {
      click: () => {
        store.dispatch({ kind: "select", selection: null });
      },
    },
  });
  const card = el("section", { class: "card selection", attrs: { "aria-live": "polite" } }, title, close, lines);
  parent.append(card);
  let drawn = "";

  return (state) => {
    const description = describe(state);
    setShown(card, description !== null);
    const now = JSON.stringify(description);
    if (description === null || now === drawn) return;
    drawn = now;
    setText(title, description.title);
    lines.replaceChildren(
      ...description.lines.flatMap(([name, value]) => [el("dt", { text: name }), el("dd", { text: value })]),
    );
  };
}
