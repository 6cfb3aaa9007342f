import { describe, expect, it } from "vitest";
import { crc32, zipped } from "../src/zip";
import { unzip } from "./mock/imports.mjs";

const text = (words: string): Uint8Array<ArrayBuffer> => new Uint8Array(new TextEncoder().encode(words));

describe("a zip", () => {
  it("has the checksums that the standard names", () => {
    expect(crc32(text("123456789"))).toBe(0xcbf43926);
    expect(crc32(new Uint8Array())).toBe(0);
  });

  it("holds each file as it was, under its name", async () => {
    const long = new Uint8Array(300_000).map((_, at) => (at * at) % 251);
    const blob = await zipped([
      { name: "Erdgeschoß.yaml", bytes: text("image: floor.pgm\n") },
      { name: "floor.pgm", bytes: long },
      { name: "empty", bytes: new Uint8Array() },
    ]);
    expect(blob.type).toBe("application/zip");
    const bytes = Buffer.from(await blob.arrayBuffer());
    const files = unzip(bytes);
    expect([...files.keys()]).toEqual(["Erdgeschoß.yaml", "floor.pgm", "empty"]);
    expect(files.get("Erdgeschoß.yaml")?.toString("utf8")).toBe("image: floor.pgm\n");
    expect(new Uint8Array(files.get("floor.pgm") ?? [])).toEqual(long);
    expect(files.get("empty")?.length).toBe(0);
    expect(bytes.length).toBeLessThan(long.length);
  });
});
