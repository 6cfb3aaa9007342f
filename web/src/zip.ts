// A zip of a few files, packed by the browser. Knows no more of the format than it takes to write
// one (PKWARE's APPNOTE, sections 4.3.7, 4.3.12 and 4.3.16): no folders, no times, nothing beyond 4 GB.

/** A file to be packed. */
export interface Packable {
  name: string;
  bytes: Uint8Array<ArrayBuffer>;
}

const LOCAL = 0x04034b50;
const CENTRAL = 0x02014b50;
const END = 0x06054b50;
/** What a reader must know: deflate, the least version that has it, and that names are UTF-8. */
const VERSION = 20;
const DEFLATE = 8;
const UTF_8 = 0x0800;
/** 1 January 1980, the least that the format can say. */
const NO_DATE = 0x0021;

const CRC_TABLE = Uint32Array.from({ length: 256 }, (_, byte) => {
  let crc = byte;
  for (let bit = 0; bit < 8; bit++) crc = crc & 1 ? (crc >>> 1) ^ 0xedb88320 : crc >>> 1;
  return crc;
});

/** The checksum of the format (ISO 3309). */
export function crc32(bytes: Uint8Array): number {
  let crc = 0xffffffff;
  for (const byte of bytes) crc = (crc >>> 8) ^ (CRC_TABLE[(crc ^ byte) & 0xff] ?? 0);
  return (crc ^ 0xffffffff) >>> 0;
}

async function packed(bytes: Uint8Array<ArrayBuffer>): Promise<Uint8Array<ArrayBuffer>> {
  const stream = new Blob([bytes]).stream().pipeThrough(new CompressionStream("deflate-raw"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Little-endian numbers, each as [bytes, value]. */
function numbers(...fields: readonly (readonly [2 | 4, number])[]): Uint8Array<ArrayBuffer> {
  const view = new DataView(new ArrayBuffer(fields.reduce((sum, [bytes]) => sum + bytes, 0)));
  let at = 0;
  for (const [bytes, value] of fields) {
    if (bytes === 2) view.setUint16(at, value, true);
    else view.setUint32(at, value, true);
    at += bytes;
  }
  return new Uint8Array(view.buffer);
}

/** The files as one zip. */
export async function zipped(files: readonly Packable[]): Promise<Blob> {
  const parts: Uint8Array<ArrayBuffer>[] = [];
  const directory: Uint8Array<ArrayBuffer>[] = [];
  let offset = 0;
  for (const { name, bytes } of files) {
    const [title, content] = [new Uint8Array(new TextEncoder().encode(name)), await packed(bytes)];
    const common = [
      [2, VERSION],
      [2, UTF_8],
      [2, DEFLATE],
      [2, 0],
      [2, NO_DATE],
      [4, crc32(bytes)],
      [4, content.length],
      [4, bytes.length],
      [2, title.length],
      [2, 0],
    ] as const;
    const head = numbers([4, LOCAL], ...common);
    directory.push(numbers([4, CENTRAL], [2, VERSION], ...common, [2, 0], [2, 0], [2, 0], [4, 0], [4, offset]), title);
    parts.push(head, title, content);
    offset += head.length + title.length + content.length;
  }
  const size = directory.reduce((sum, part) => sum + part.length, 0);
  const end = numbers([4, END], [2, 0], [2, 0], [2, files.length], [2, files.length], [4, size], [4, offset], [2, 0]);
  return new Blob([...parts, ...directory, end], { type: "application/zip" });
}
