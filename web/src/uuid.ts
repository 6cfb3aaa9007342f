// Identities made on the page. `crypto.randomUUID` is there on secure origins only, and plants often
// have none.

/** A UUID of version 4 from 16 random bytes (RFC 9562, section 5.4). */
export function uuidFrom(random: Uint8Array): string {
  const hex = [...random.slice(0, 16)]
    .map((byte, index) => (index === 6 ? (byte & 0x0f) | 0x40 : index === 8 ? (byte & 0x3f) | 0x80 : byte))
    .map((byte) => byte.toString(16).padStart(2, "0"))
    .join("");
  return [hex.slice(0, 8), hex.slice(8, 12), hex.slice(12, 16), hex.slice(16, 20), hex.slice(20)].join("-");
}
