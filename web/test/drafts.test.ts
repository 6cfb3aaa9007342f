import { describe, expect, it } from "vitest";
import { mayPublish } from "../src/drafting";
import { entryInWords, NO_DRAFT, placeOf, readiness, type DraftState } from "../src/drafts";
import { initialState, update } from "../src/state";
import type { GdbEntry, GdbFinding } from "../src/wire";
import { NO_LINK, NOON_MS } from "./samples";

function entry(fields: Partial<GdbEntry> = {}): GdbEntry {
  return { id: "e", revision: 7, kind: "edit", draft: 7, library: 2, at: "2026-11-22T12:00:00Z", author: "mia", comment: "", put: 1, removed: 0, ...fields };
}

function draft(entries: GdbEntry[], list: GdbFinding[] = []): DraftState {
  return { ...NO_DRAFT, entries, findings: { draft: 7, library: 2, list } };
}

const gap: GdbFinding = { severity: "error", code: "open_shell", detail: "The shell is open.", at_m: [1, 2, 0] };

describe("a draft", () => {
  it("is ready if it is another than what robots have and has no errors", () => {
    expect(readiness(NO_DRAFT)).toBe("unknown");
    expect(readiness(draft([]))).toBe("no-model");
    expect(readiness(draft([entry()]))).toBe("ready");
    expect(readiness(draft([entry()], [gap]))).toBe("has-errors");
    expect(readiness(draft([entry()], [{ ...gap, severity: "warning" }]))).toBe("ready");
  });

  it("is published only with the library that robots have it with", () => {
    const published = entry({ kind: "publication", revision: 8 });
    expect(readiness(draft([published, entry()]))).toBe("published");
    expect(readiness(draft([{ ...published, library: 1 }, entry()]))).toBe("ready");
    expect(readiness(draft([entry({ revision: 9, draft: 9 }), published]))).toBe("ready");
  });

  it("has a log in words", () => {
    expect(entryInWords(entry({ put: 2, removed: 1, comment: "north door" }))).toBe("2 objects put, 1 removed: north door");
    expect(entryInWords(entry({ kind: "publication" }))).toBe("Published draft #7");
  });

  it("shows on the map only what is between objects of the level", () => {
    expect(placeOf(gap)).toBeNull();
    expect(placeOf({ ...gap, other: "another" })).toEqual([1, 2]);
  });

  it("is published by those who may", () => {
    const state = initialState(NO_LINK, NOON_MS);
    const signedIn = (scopes: ("map:edit" | "map:publish" | "admin")[]) =>
      update(state, { kind: "session", session: { kind: "in", who: { id: "t", scopes, site: null, robot: null, expires_at: null } } });
    expect([state, signedIn(["map:edit"]), signedIn(["map:publish"]), signedIn(["admin"])].map(mayPublish)).toEqual([false, false, true, true]);
  });
});
