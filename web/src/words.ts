// Numbers, lengths and times in words for people.

const MINUS = "\u2212";
const NARROW_SPACE = "\u202f";

/** A count with its thousands apart: 12 345. */
export function count(value: number): string {
  return String(Math.round(value)).replace(/\B(?=(\d{3})+$)/g, NARROW_SPACE);
}

/** A number and the word it counts: "1 segment", "2 segments". */
export function counted(value: number, one: string, many = `${one}s`): string {
  return `${count(value)} ${value === 1 ? one : many}`;
}

/** A number with a fixed number of decimals and a true minus sign; never a negative zero. */
export function fixed(value: number, decimals: number): string {
  const text = Math.abs(value).toFixed(decimals);
  return value < 0 && Number(text) !== 0 ? MINUS + text : text;
}

/** A coordinate: to the centimetre. */
export function coordinate(metres: number): string {
  return `${fixed(metres, 2)} m`;
}

/** A length with the unit that suits it. */
export function lengthInWords(metres: number): string {
  if (metres >= 1000) return `${trimmed(metres / 1000)} km`;
  if (metres >= 1) return `${trimmed(metres)} m`;
  if (metres >= 0.01) return `${trimmed(metres * 100)} cm`;
  return `${trimmed(metres * 1000)} mm`;
}

/** An angle in degrees. */
export function degrees(radians: number, decimals = 1): string {
  return `${fixed((radians * 180) / Math.PI, decimals)}°`;
}

function trimmed(value: number): string {
  return String(Number(value.toPrecision(3)));
}

/** Log-odds in nats as a probability, never rounded up to certainty: "95 %", "99.9 %". */
export function likelihood(nat: number): string {
  const percent = 100 / (1 + Math.exp(-nat));
  return percent < 99 ? `${fixed(percent, 0)} %` : `${fixed(Math.min(percent, 99.9), 1)} %`;
}

/** How long ago, roughly. */
export function ago(sinceMs: number, nowMs: number): string {
  const seconds = Math.max(0, Math.floor((nowMs - sinceMs) / 1000));
  if (seconds < 5) return "just now";
  if (seconds < 60) return `${seconds} s ago`;
  const minutes = Math.floor(seconds / 60);
  if (minutes < 60) return `${minutes} min ago`;
  const hours = Math.floor(minutes / 60);
  if (hours < 48) return `${hours} h ago`;
  return `${Math.floor(hours / 24)} days ago`;
}

/** An instant in the reader's own time zone, "2026-11-22 14:03:05"; the text itself if it is none. */
export function instant(rfc3339: string): string {
  const time = new Date(rfc3339);
  if (Number.isNaN(time.getTime())) return rfc3339;
  const two = (value: number): string => String(value).padStart(2, "0");
  const day = `${time.getFullYear()}-${two(time.getMonth() + 1)}-${two(time.getDate())}`;
  return `${day} ${two(time.getHours())}:${two(time.getMinutes())}:${two(time.getSeconds())}`;
}

/** Names one after the other: "a", "a and b", "a, b and c". */
export function listed(names: readonly string[]): string {
  if (names.length < 2) return names.join("");
  return `${names.slice(0, -1).join(", ")} and ${names.at(-1) ?? ""}`;
}
