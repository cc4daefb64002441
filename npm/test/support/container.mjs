// Reads and writes the container of streams (docs/format.md), for tests that modify streams.

export const END = 0;
export const SEGMENT = 5;
export const BLOCK = 16;
export const COEFFICIENTS = 19;
export const TRACK_BLOCK = 23;
export const VALUES = 24;
export const MISSING = 25;
export const INDEX = 130;
export const PARTS = 134;
export const IMAGE = 137;
export const TRACK = 138;
export const TIMES = 140;
export const HARD_EDGES = 139;

const TABLE = Uint32Array.from({ length: 256 }, (_, byte) => {
  let sum = byte;
  for (let i = 0; i < 8; i++) sum = sum & 1 ? (sum >>> 1) ^ 0xedb88320 : sum >>> 1;
  return sum;
});

export function crc32(bytes) {
  let sum = 0xffffffff;
  for (const byte of bytes) sum = (sum >>> 8) ^ TABLE[(sum ^ byte) & 255];
  return ~sum >>> 0;
}

/** Position of the number of frames in a header; those of vertices and faces follow. */
export const FRAMES_AT = 9;

/** Return the size of the header, and whether the stream is compact. */
function headerOf(bytes) {
  let [, position] = varintAt(bytes, FRAMES_AT);
  for (let i = 0; i < 2; i++) [, position] = varintAt(bytes, position);
  const [rate, codes] = varintAt(bytes, position);
  const form = codes + (rate ? 1 : 9);
  const [name, begin] = varintAt(bytes, form + 1 + (bytes[form] & 32 ? 32 : 16));
  const isCompact = (bytes[form] & 64) !== 0;
  return { size: begin + name + (isCompact ? 0 : 4), isCompact };
}

export function headerSize(bytes) {
  return headerOf(bytes).size;
}

/** Parse all sections of a stream: `position` to `end`, with the payload at `begin`. */
export function sectionsOf(bytes) {
  const sections = [];
  const { size, isCompact } = headerOf(bytes);
  for (let position = size; position < bytes.length;) {
    const [length, begin] = varintAt(bytes, position + 1);
    const id = bytes[position];
    const end = begin + length + (isCompact && id !== END ? 0 : 4);
    sections.push({ id, position, begin, end, payload: bytes.subarray(begin, begin + length) });
    position = end;
  }
  return sections;
}

/** Return the byte range of each track in each block. */
export function groupsOf(bytes) {
  const blocks = [];
  for (const { id, position, end } of sectionsOf(bytes)) {
    if (id === BLOCK) blocks.push([]);
    if (id === BLOCK || id === TRACK_BLOCK) blocks.at(-1).push([position, end]);
    else if (![INDEX, END, TIMES].includes(id) && blocks.length) blocks.at(-1).at(-1)[1] = end;
  }
  return blocks;
}

/** Update the checksum of a section that was changed in place, or of the compact stream. */
export function seal(bytes, section) {
  const { position, end } = headerOf(bytes).isCompact ? { position: 0, end: bytes.length } : section;
  const sum = crc32(bytes.subarray(position, end - 4));
  new DataView(bytes.buffer, bytes.byteOffset).setUint32(end - 4, sum, true);
}

/** Update the checksum of the header. */
export function sealHeader(bytes) {
  seal(bytes, { position: 0, end: headerSize(bytes) });
}

export function sectionBytes(id, payload) {
  const bytes = Uint8Array.from([id, ...varint(payload.length), ...payload, 0, 0, 0, 0]);
  seal(bytes, { position: 0, end: bytes.length });
  return bytes;
}

export function varint(value) {
  const bytes = [];
  for (; value >= 128; value = Math.floor(value / 128)) bytes.push((value % 128) + 128);
  return [...bytes, value];
}

/** Return the integer at a position, and the position after it. */
export function varintAt(bytes, position) {
  let [value, scale] = [0, 1];
  for (; bytes[position] >= 128; scale *= 128) value += (bytes[position++] - 128) * scale;
  return [value + bytes[position] * scale, position + 1];
}
