// Streams of conformance/ that have tracks, changed: large, or with another TRACK.

import { loadInternals } from "./bundle.mjs";
import { bytesOf } from "./streams.mjs";

const { Section, crc32, readHeader, readSection, readStream } = await loadInternals();

/** A section that readers skip. */
const UNKNOWN = 0xc0;

/** A stream of three blocks and tracks whose groups are each far larger than what holds an index. */
export function largeTracks() {
  return rewritten(bytesOf("tracks"), (sections) =>
    sections.flatMap((one) => {
      const isFirst = one.id === Section.BLOCK || one.id === Section.TRACK_BLOCK;
      return isFirst ? [one, { id: UNKNOWN, payload: new Uint8Array(20_000) }] : [one];
    }),
  );
}

/** The stream "tracks" whose last track is exact, and whose end is missing, with its index. */
export function withExactTrack() {
  let nTracks = 0;
  let place = 0;
  const bytes = rewritten(bytesOf("tracks"), (sections) =>
    sections.flatMap(({ id, payload }) => {
      if (id === Section.TRACK && ++nTracks === 3) {
        return [{ id, payload: changed(payload, { coding: 1, exact: true }) }];
      }
      place = id === Section.BLOCK ? 0 : place + (id === Section.TRACK_BLOCK);
      if (nTracks < 3 || place < 3) return [{ id, payload }];
      if (id === Section.TRACK_BLOCK) return [{ id, payload: new Uint8Array(1) }];
      return id === Section.COEFFICIENTS ? [{ id: Section.VALUES, payload }] : [];
    }),
  );
  const end = new DataView(bytes.buffer, bytes.byteOffset + bytes.length - 12);
  return bytes.subarray(0, Number(end.getBigUint64(0, true)));
}

/** The stream "tracks" with a section MISSING, of bytes of 255, in a block of its first track. */
export function withMissingValues() {
  const nFlags = 42 * readStream(bytesOf("tracks")).places[0].nFrames;
  const payload = new Uint8Array(nFlags + 1).fill(255);
  let count = 0;
  return rewritten(bytesOf("tracks"), (sections) =>
    sections.flatMap((one) => {
      const isFirst = one.id === Section.TRACK_BLOCK && count++ === 0;
      return isFirst ? [one, { id: Section.MISSING, payload }] : [one];
    }),
  );
}

/**
 * The stream "tracks" with something else in one of its sections TRACK.
 *
 * @param change - Codes `kind`, `domain`, `type`, `coding`; the `name`; `nColumns`;
 *   `bound`, `scale` or the first `origin`; how many bytes come `more`; or the `length` that is left.
 */
export function withTrack(number, change) {
  let count = 0;
  return rewritten(bytesOf("tracks"), (sections) =>
    sections.map((one) => {
      if (one.id !== Section.TRACK || count++ !== number) return one;
      return { ...one, payload: changed(one.payload, change) };
    }),
  );
}

function changed(before, change) {
  const keys = ["kind", "domain", "type", "coding"];
  const codes = keys.map((key, i) => change[key] ?? before[i]);
  const unit = 5 + before[4];
  const columns = unit + 1 + before[unit];
  const name = new TextEncoder().encode(change.name ?? "");
  const named = change.name ? [name.length, ...name] : before.slice(4, unit);
  const names = [...named, ...before.slice(unit, columns)];
  const numbers = before.slice(columns + 1);
  const view = new DataView(numbers.buffer);
  ["bound", "scale", "origin"].forEach((key, i) => {
    if (change[key] !== undefined) view.setFloat64(8 * i, change[key], true);
  });
  const { nColumns = before[columns], more = 0, length, exact } = change;
  const all = [...codes, ...names, ...varint(nColumns), ...(exact ? [] : numbers), ...new Uint8Array(more)];
  return Uint8Array.from(all.slice(0, length));
}

/** A stream with other sections, and an index of these. */
function rewritten(bytes, change) {
  const start = readHeader(bytes).sizeBytes;
  const sections = [];
  for (let position = start; position < bytes.length;) {
    const section = readSection({ bytes, start: 0 }, position, bytes.length);
    sections.push(section);
    position = section.end;
  }
  const isOfEnd = ({ id }) => id === Section.INDEX || id === Section.END;
  const parts = [bytes.slice(0, start)];
  const blocks = [];
  let position = start;
  for (const { id, payload } of change(sections.filter((one) => !isOfEnd(one)))) {
    if (id === Section.BLOCK) blocks.push({ position, nFrames: payload[0], sizes: [] });
    if (id === Section.BLOCK || id === Section.TRACK_BLOCK) blocks.at(-1).sizes.push(0);
    const written = sectionOf(id, payload);
    parts.push(written);
    position += written.length;
    const sizes = blocks.at(-1)?.sizes;
    if (sizes) sizes[sizes.length - 1] += written.length;
  }
  const listed = blocks.flatMap(({ nFrames, sizes }) => [nFrames, ...sizes]);
  const index = [blocks[0].position, blocks.length, ...listed].flatMap(varint);
  const end = new Uint8Array(8);
  new DataView(end.buffer).setBigUint64(0, BigInt(position), true);
  parts.push(sectionOf(Section.INDEX, Uint8Array.from(index)), sectionOf(Section.END, end));
  return new Uint8Array(Buffer.concat(parts));
}

function sectionOf(id, payload) {
  const head = Uint8Array.from([id, ...varint(payload.length), ...payload]);
  const sum = new Uint8Array(4);
  new DataView(sum.buffer).setUint32(0, crc32(head), true);
  return Buffer.concat([head, sum]);
}

function varint(value) {
  const bytes = [];
  for (; value >= 128; value = Math.floor(value / 128)) bytes.push((value % 128) + 128);
  return [...bytes, value];
}
