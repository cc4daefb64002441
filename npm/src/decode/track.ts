// What a stream says of a track before its first block, and the groups of its blocks.

import { CorruptStreamError, UnsupportedVersionError } from "../errors.js";
import {
  type StoredBlock,
  blockPayload,
  groupSections,
  readLayout,
} from "../stream/block_sections.js";
import { ByteReader } from "../stream/byte_reader.js";
import type { BlockPlace } from "../stream/index_section.js";
import { Section } from "../stream/layout.js";
import type { Placement } from "./frames.js";
import { BOUNDED, DOMAINS, EXACT, KINDS } from "./track_infos.js";

const MAX_COLUMNS = 256;

/** Numbers that a value of a kind may have; of other kinds any. */
const COLUMNS_OF: Partial<Record<(typeof KINDS)[number], readonly number[]>> = {
  vector: [2, 3],
  velocity: [3],
  normal: [3],
  color: [3, 4],
  uv: [2],
  scalar: [1],
};

/** The numbers of a track in a block are at most so many for each byte of its group. */
const MAX_NUMBERS_PER_BYTE = 768;

/** What a track is, and how its numbers lie in their range. */
export interface Track extends Placement {
  readonly kind: (typeof KINDS)[number];
  readonly domain: (typeof DOMAINS)[number];
}

/**
 * A track, from the payload of its section TRACK.
 *
 * @throws CorruptStreamError, TruncatedStreamError where it contradicts itself, or is cut off.
 * @throws UnsupportedVersionError where it is of a newer build.
 */
export function readTrack(payload: Uint8Array): Track {
  const reader = new ByteReader(payload);
  const [kind, domain, numberType, coding] = reader.take(4, "a track is cut off");
  const name = `track '${reader.text()}'`;
  reader.text();
  const nColumns = reader.varint();
  if (coding === EXACT) {
    throw new UnsupportedVersionError(
      `${name} is coded exactly, which this build does not read; upgrade meshreel`,
    );
  }
  const isKnown = kind in KINDS && domain in DOMAINS && coding === BOUNDED;
  if (!isKnown || (numberType !== 4 && numberType !== 8)) {
    throw new UnsupportedVersionError(
      `${name} has kind ${kind}, domain ${domain}, number type ${numberType} and coding ` +
        `${coding}, one of which is unknown to this build; upgrade meshreel`,
    );
  }
  if (!(nColumns >= 1 && nColumns <= MAX_COLUMNS)) {
    throw new CorruptStreamError(
      `${name} has ${nColumns} columns; at most ${MAX_COLUMNS} are allowed`,
    );
  }
  const columns = COLUMNS_OF[KINDS[kind]];
  if (columns && !columns.includes(nColumns)) {
    throw new CorruptStreamError(`${name} has ${nColumns} columns; ${KINDS[kind]} has not`);
  }
  const nNumbers = 2 + nColumns;
  if (reader.left !== 8 * nNumbers) {
    throw new CorruptStreamError(
      `${name} of type float${8 * numberType} has ${reader.left} bytes of numbers; ` +
        `${8 * nNumbers} are needed`,
    );
  }
  const numbers = Array.from({ length: nNumbers }, () => reader.float64(""));
  const [bound, scale, ...origin] = numbers;
  if (!(bound >= 0 && scale > 0 && numbers.every(Number.isFinite))) {
    throw new CorruptStreamError(`${name} has a bound, scale or origin that cannot be`);
  }
  return { kind: KINDS[kind], domain: DOMAINS[domain], vertexType: numberType, scale, origin };
}

/**
 * A track in a block.
 *
 * @param bytes - Of its group.
 * @param place - Of the block in its stream.
 * @param position - Byte of the stream at which the group begins.
 * @param track - Number of the track, from 1 on.
 * @throws CorruptStreamError where it is damaged, or has more modes or numbers than can be.
 * @throws UnsupportedVersionError where values are missing.
 */
export function readTrackBlock(
  bytes: Uint8Array,
  { nFrames, sizes }: BlockPlace,
  position: number,
  track: number,
  [number, start]: [number: number, start: number],
  [nItems, nColumns]: [nItems: number, nColumns: number],
): StoredBlock {
  const id = Section.TRACK_BLOCK;
  const ofTrack = ` of track ${track}`;
  const sections = groupSections(bytes, position, sizes[track], id, number, ofTrack);
  if (sections.has(Section.MISSING)) {
    throw new UnsupportedVersionError(
      `block ${number}${ofTrack} has missing values, which this build does not read; upgrade meshreel`,
    );
  }
  const reader = new ByteReader(sections.get(id)!);
  const nModes = reader.varint();
  const most = nColumns * nFrames;
  if (!(nModes >= 1 && nModes <= most) || reader.left) {
    throw new CorruptStreamError(
      `track ${track} has ${nModes} modes in a block of ${nFrames} frames; 1 to ${most} are possible`,
    );
  }
  if (most * nItems > MAX_NUMBERS_PER_BYTE * sizes[track]) {
    throw new CorruptStreamError(
      `track ${track} announces ${most * nItems} numbers in ${sizes[track]} bytes; at most ` +
        `${MAX_NUMBERS_PER_BYTE} a byte are allowed`,
    );
  }
  const stored = { number, start, nFrames, nModes, sections };
  return { ...stored, layout: readLayout(blockPayload(stored, Section.FIELDS)) };
}
