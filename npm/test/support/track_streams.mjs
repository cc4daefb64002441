// Modified streams: padded, or with another section TRACK.

import {
  BLOCK,
  COEFFICIENTS,
  END,
  INDEX,
  MISSING,
  SEGMENT,
  TRACK,
  TRACK_BLOCK,
  VALUES,
  headerSize,
  sectionBytes,
  sectionsOf,
  varint,
  varintAt,
} from "./container.mjs";
import { segmentedBytes, streamBytes } from "./streams.mjs";

/** Id of a section that readers skip. */
const UNKNOWN = 0xc0;

/** A stream with three blocks in which each track is padded by `padding` bytes. */
export function largeTracks(padding = 20_000) {
  return rewrite(streamBytes("tracks"), (sections) =>
    sections.flatMap((one) => {
      const isFirst = one.id === BLOCK || one.id === TRACK_BLOCK;
      return isFirst ? [one, { id: UNKNOWN, payload: new Uint8Array(padding) }] : [one];
    }),
  );
}

/** A stream of several segments whose last groups are padded by `padding` bytes. */
export function largeSegments(name, padding = 100_000) {
  const unknown = { id: UNKNOWN, payload: new Uint8Array(padding) };
  return rewrite(segmentedBytes(name), (sections) => [
    ...sections.flatMap((one) => (one.id === SEGMENT ? [unknown, one] : [one])),
    unknown,
  ]);
}

/** The stream "tracks" with an exact last track, and without the index and the end. */
export function withExactTrack() {
  let nTracks = 0;
  let place = 0;
  const bytes = rewrite(streamBytes("tracks"), (sections) =>
    sections.flatMap(({ id, payload }) => {
      if (id === TRACK && ++nTracks === 3) {
        return [{ id, payload: changeTrack(payload, { coding: 1, exact: true }) }];
      }
      place = id === BLOCK ? 0 : place + (id === TRACK_BLOCK);
      if (nTracks < 3 || place < 3) return [{ id, payload }];
      if (id === TRACK_BLOCK) return [{ id, payload: new Uint8Array(1) }];
      return id === COEFFICIENTS ? [{ id: VALUES, payload }] : [];
    }),
  );
  const end = new DataView(bytes.buffer, bytes.byteOffset + bytes.length - 12);
  return bytes.subarray(0, Number(end.getBigUint64(0, true)));
}

/** The stream "tracks" with a section MISSING of bytes 255 in a block of its first track. */
export function withMissingValues() {
  const nFlags = 42 * sectionsOf(streamBytes("tracks")).find(({ id }) => id === BLOCK).payload[0];
  const payload = new Uint8Array(nFlags + 1).fill(255);
  let count = 0;
  return rewrite(streamBytes("tracks"), (sections) =>
    sections.flatMap((one) => {
      const isFirst = one.id === TRACK_BLOCK && count++ === 0;
      return isFirst ? [one, { id: MISSING, payload }] : [one];
    }),
  );
}

/**
 * The stream "tracks" with a modified section TRACK.
 *
 * @param change - Codes `kind`, `domain`, `type`, `coding`; the `name`; `nColumns`; `bound`,
 *   `scale` or the first `origin`; number of `more` bytes to append; or `length` to truncate to.
 */
export function withTrack(number, change) {
  let count = 0;
  return rewrite(streamBytes("tracks"), (sections) =>
    sections.map((one) => {
      if (one.id !== TRACK || count++ !== number) return one;
      return { ...one, payload: changeTrack(one.payload, change) };
    }),
  );
}

function changeTrack(before, change) {
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

/** Write a stream with changed sections and a new index. */
function rewrite(bytes, change) {
  const start = headerSize(bytes);
  const isTrailer = ({ id }) => id === INDEX || id === END;
  const parts = [bytes.slice(0, start)];
  const segments = [{ head: [], blocks: [] }];
  let position = start;
  for (const { id, payload } of change(sectionsOf(bytes).filter((one) => !isTrailer(one)))) {
    if (id === SEGMENT) {
      const [nVerts, second] = varintAt(payload, 0);
      const head = [nVerts, varintAt(payload, second)[0]];
      segments.push({ position, head, blocks: [] });
    }
    const { blocks } = segments.at(-1);
    if (id === BLOCK) blocks.push({ position, nFrames: payload[0], sizes: [] });
    if (id === BLOCK || id === TRACK_BLOCK) blocks.at(-1).sizes.push(0);
    const section = sectionBytes(id, payload);
    parts.push(section);
    position += section.length;
    const sizes = blocks.at(-1)?.sizes;
    if (sizes) sizes[sizes.length - 1] += section.length;
  }
  const index = segments
    .flatMap(({ position: begin = 0, head, blocks }) => [
      ...(head.length ? [...head, blocks[0].sizes.length] : []),
      blocks[0].position - begin,
      blocks.length,
      ...blocks.flatMap(({ nFrames, sizes }) => [nFrames, ...sizes]),
    ])
    .flatMap(varint);
  const end = new Uint8Array(8);
  new DataView(end.buffer).setBigUint64(0, BigInt(position), true);
  parts.push(sectionBytes(INDEX, Uint8Array.from(index)), sectionBytes(END, end));
  return new Uint8Array(Buffer.concat(parts));
}
