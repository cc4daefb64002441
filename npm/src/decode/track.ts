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
import { requireBlock } from "./memory.js";
import { FLOATS, NUMBER_TYPES, type NumberType } from "./number_types.js";
import { BACKWARD, TURN_COLUMNS, TURNS } from "./predicted.js";
import {
  DOMAINS,
  EXACT,
  EXACT_FORWARD,
  IN_ROWS,
  KINDS,
  OF_VERTICES,
  isExactCoding,
} from "./track_infos.js";

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

/** What a track is. */
export interface Track {
  readonly kind: (typeof KINDS)[number];
  readonly domain: (typeof DOMAINS)[number];
  readonly nColumns: number;
  readonly numbers: NumberType;
  readonly coding: number;
  /** Columns that are coded: fewer than it has, where normals are turned. */
  readonly nCoded: number;
  /** Whether what is decoded changes what positions let expect, exactly or not. */
  readonly isPredicted: boolean;
  /** Of velocities that are predicted. */
  readonly rate: number;
  /** Whether corners have the values of their vertices, or of rows. */
  readonly shared: "vertices" | "rows" | null;
  /** What rows there are, as it is stored. */
  readonly rows: Uint8Array;
  /** How decoded numbers lie in their range; null of a track that is coded exactly. */
  readonly placement: Placement | null;
}

/** A track in a block, as it is stored. */
export type StoredTrackBlock = Omit<StoredBlock, "layout">;

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
  const isExact = isExactCoding(coding);
  const numbers = NUMBER_TYPES.get(numberType);
  const isKnown = kind in KINDS && domain in DOMAINS && coding <= EXACT_FORWARD;
  if (!isKnown || !numbers || !(coding === EXACT || numbers.type === FLOATS)) {
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
  const isPredicted = coding >= TURNS;
  const hasRate = coding >= BACKWARD;
  const [kindName, domainName] = [KINDS[kind], DOMAINS[domain]];
  const isOfKind = hasRate
    ? kindName === "velocity" && (domainName === "vertex" || domain === OF_VERTICES)
    : !isPredicted || kindName === "normal";
  if (!isOfKind) {
    throw new CorruptStreamError(
      `${name} is predicted as no ${kindName} of each ${domainName} is`,
    );
  }
  const nNumbers = (isExact ? 0 : 2) + (isPredicted || isExact ? Number(hasRate) : nColumns);
  if (domain === IN_ROWS ? reader.left < 8 * nNumbers : reader.left !== 8 * nNumbers) {
    throw new CorruptStreamError(
      `${name} of type ${numbers.name} has ${reader.left} bytes of numbers; ` +
        `${8 * nNumbers} are needed`,
    );
  }
  const placed = Array.from({ length: nNumbers }, () => reader.float64(""));
  const [bound, scale, ...others] = isExact ? [0, 1, ...placed] : placed;
  if (!(bound >= 0 && scale > 0 && placed.every(Number.isFinite))) {
    throw new CorruptStreamError(`${name} has a bound, scale, origin or rate that cannot be`);
  }
  const nCoded = coding === TURNS ? TURN_COLUMNS : nColumns;
  const origin = isPredicted ? Array<number>(nCoded).fill(0) : others;
  const vertexType = isPredicted ? 8 : (numbers.sizeBytes as 4 | 8);
  return {
    ...{ kind: kindName, domain: domainName, nColumns, numbers, coding, nCoded, isPredicted },
    rate: hasRate ? others[0] : 0,
    shared: domain === OF_VERTICES ? "vertices" : domain === IN_ROWS ? "rows" : null,
    rows: reader.rest(),
    placement: isExact ? null : { vertexType, scale, origin },
  };
}

/**
 * A track in a block.
 *
 * @param bytes - Of its group.
 * @param place - Of the block in its stream.
 * @param position - Byte of the stream at which the group begins.
 * @param track - Number of the track, from 1 on.
 * @param isExact - Whether it has values, and no modes.
 * @param numberBytes - Size of a number of the track.
 * @param memory - Bytes that decoding may take at once.
 * @throws CorruptStreamError where it is damaged, or has more modes than can be.
 * @throws MemoryLimitError where it is larger than allowed.
 */
export function readTrackBlock(
  bytes: Uint8Array,
  { nFrames, sizes }: BlockPlace,
  position: number,
  track: number,
  [number, start]: [number: number, start: number],
  [nItems, nColumns]: [nItems: number, nColumns: number],
  isExact: boolean,
  numberBytes: number,
  memory: number,
): StoredTrackBlock {
  const id = Section.TRACK_BLOCK;
  const ofTrack = ` of track ${track}`;
  const sections = groupSections(bytes, position, sizes[track], id, number, ofTrack);
  const reader = new ByteReader(sections.get(id)!);
  const nModes = reader.varint();
  const nNumbers = nColumns * nFrames;
  const [least, most] = isExact ? [0, 0] : [1, nNumbers];
  if (!(nModes >= least && nModes <= most) || reader.left) {
    throw new CorruptStreamError(
      `track ${track} has ${nModes} modes in a block of ${nFrames} frames; ${least} to ${most} ` +
        "are possible",
    );
  }
  const stored = { number, start, nFrames, nModes, sections };
  requireBlock(memory, stored, [nItems, nColumns], numberBytes);
  return stored;
}

/** What `readTrackBlock` gave of a track with modes, with how these are predicted. */
export function withLayout(stored: StoredTrackBlock): StoredBlock {
  return { ...stored, layout: readLayout(blockPayload(stored, Section.FIELDS)) };
}
