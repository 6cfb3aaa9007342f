// What a robot can observe.

import type { RobotDescription } from "./wire";

/** What a robot can observe, in words. */
export function competenceInWords(robot: RobotDescription): string {
  const kinds = robot.competence.map((kind) => {
    const sensors = robot.sensors.filter((sensor) => sensor.kind === kind);
    return sensors.length > 0 && sensors.every((sensor) => sensor.emulated) ? `${kind} (emulated)` : kind;
  });
  return kinds.length === 0 ? "no sensors" : kinds.join(" + ");
}
