// A block of frames as it is stored: its sections, and what they say of how it is decoded.

import { CorruptStreamError, TruncatedStreamError, UnsupportedVersionError } from "../errors.js";
import { ByteReader } from "./byte_reader.js";
import type { BlockPlace } from "./index_section.js";
import { Section, isOfBlock, sectionName } from "./layout.js";
import { readSections } from "./sections.js";

const SINGLE = 4;
const DOUBLE = 8;
const MAX_STENCIL = 16;
const MAX_LEARNED = 255;
const MAX_STEP = 1e6;
/** Is added to the layout of blocks that have resting times. */
const WITH_RESTS = 16;
const MAX_REST_BITS = 8;

/** How the fields of a block are predicted. */
export interface Layout {
  /** Bytes of the numbers that frames are summed up in. */
  readonly precision: 4 | 8;
  /** How many blocks before this one its key block is; 0 where it has none. */
  readonly reference: number;
  /** Quantisation step of the fields, in diagonals. */
  readonly step: number;
  readonly stencilSize: number;
  /** Modes that predictor weights follow. */
  readonly nLearned: number;
  /** Modes, the first ones, whose fields are those of the key block. */
  readonly nReused: number;
  /** Steps of the vectors of these modes in one of a position; 0 where there are none. */
  readonly finer: number;
  /** Times that are predicted from the one before: first and end of each run, ascending. */
  readonly rests: readonly (readonly [number, number])[];
  /** Integers of these times are divided by 2 to this power. */
  readonly restBits: number;
}

/** A track in a block, as it is stored: the positions, or a further one. */
export interface StoredBlock {
  readonly number: number;
  /** Number of its first frame. */
  readonly start: number;
  readonly nFrames: number;
  readonly nModes: number;
  readonly layout: Layout;
  /** Payloads by id. */
  readonly sections: ReadonlyMap<number, Uint8Array>;
}

/**
 * The positions in a block.
 *
 * @param bytes - Of its first group, or of the whole block: `place.sizes[0]` of them are read.
 * @param place - Of the block in its stream.
 * @param number - Of the block.
 * @param start - Number of its first frame.
 * @throws CorruptStreamError where they are damaged, or not those of this place.
 * @throws UnsupportedVersionError where they are of a newer build.
 */
export function readBlock(
  bytes: Uint8Array,
  place: BlockPlace,
  number: number,
  start: number,
): StoredBlock {
  const stored = readPositions(bytes, place, number, start);
  const { nFrames, nModes } = stored;
  if (!nModes) {
    throw new CorruptStreamError(
      `a block announces ${nFrames} frames and ${nModes} modes; each must be at least 1`,
    );
  }
  return { ...stored, layout: readLayout(blockPayload(stored, Section.FIELDS)) };
}

/** The same, with any number of modes, and without how fields are predicted; exact ones have none. */
export function readPositions(
  bytes: Uint8Array,
  place: BlockPlace,
  number: number,
  start: number,
): Omit<StoredBlock, "layout"> {
  const sections = groupSections(bytes, place.position, place.sizes[0], Section.BLOCK, number);
  const [nFrames, nModes] = readCounts(sections.get(Section.BLOCK)!);
  if (nFrames !== place.nFrames) {
    throw new CorruptStreamError(
      `block ${number} has ${nFrames} frames; the index has ${place.nFrames}`,
    );
  }
  if (nModes > 3 * nFrames) {
    throw new CorruptStreamError(
      `a block of ${nFrames} frames has ${nModes} modes; ${3 * nFrames} are possible`,
    );
  }
  return { number, start, nFrames, nModes, sections };
}

/**
 * The payload of a section of a block.
 *
 * @throws CorruptStreamError where the block has none.
 */
export function blockPayload(
  { sections, start, nFrames }: Pick<StoredBlock, "sections" | "start" | "nFrames">,
  id: number,
): Uint8Array {
  const found = sections.get(id);
  if (found) return found;
  throw new CorruptStreamError(
    `the block of frames ${start}..${start + nFrames - 1} has no section ${sectionName(id)}`,
  );
}

/**
 * Checks a step of fields or corrections.
 *
 * @returns Whether it is in the range that the format allows.
 */
export function isStep(step: number): boolean {
  return step > 0 && step < MAX_STEP;
}

/**
 * The sections of a track in a block, by id; throws as `readBlock`.
 *
 * @param bytes - Of its group.
 * @param position - Byte of the stream at which the group begins.
 * @param first - The section that it begins with.
 * @param number - Of the block.
 * @param ofTrack - What is said of it where it does not, such as " of track 2".
 */
export function groupSections(
  bytes: Uint8Array,
  position: number,
  sizeBytes: number,
  first: number,
  number: number,
  ofTrack = "",
): Map<number, Uint8Array> {
  const found = new Map<number, Uint8Array>();
  const stretch = { bytes, start: position };
  const name = sectionName(first);
  for (const { id, payload } of readSections(stretch, position, position + sizeBytes)) {
    if ((id === first) !== !found.size) {
      throw new CorruptStreamError(`block ${number} does not begin with a section ${name}${ofTrack}`);
    }
    if (isOfBlock(id)) {
      if (found.has(id)) {
        throw new CorruptStreamError(`section ${sectionName(id)} is out of place`);
      }
      found.set(id, payload);
    }
  }
  if (!found.size) throw new CorruptStreamError(`block ${number} has no section ${name}`);
  return found;
}

function readCounts(payload: Uint8Array): [number, number] {
  const reader = new ByteReader(payload);
  const [nFrames, nModes] = [reader.varint(), reader.varint()];
  if (!nFrames || reader.left) {
    throw new CorruptStreamError(
      `a block announces ${nFrames} frames and ${nModes} modes, and ${reader.left} bytes are left`,
    );
  }
  return [nFrames, nModes];
}

/**
 * How fields are predicted, from the payload of FIELDS; throws as `readBlock`.
 */
export function readLayout(payload: Uint8Array): Layout {
  const cutOff = "the layout of the fields is cut off";
  if (!payload.length) throw new TruncatedStreamError(cutOff);
  const reader = new ByteReader(payload);
  const number = reader.byte(cutOff);
  const precision = number & ~WITH_RESTS;
  if (precision !== SINGLE && precision !== DOUBLE) {
    throw new UnsupportedVersionError(
      `the fields of the stream have layout ${number}; this build reads ${SINGLE} and ${DOUBLE}, ` +
        `and ${WITH_RESTS} more; upgrade meshreel`,
    );
  }
  const reference = reader.varint();
  const step = reader.float32(cutOff);
  const [stencilSize, nLearned] = [reader.varint(), reader.varint()];
  const [rests, restBits] = number & WITH_RESTS ? readRests(reader) : [[], 0];
  let [nReused, finer] = [0, 0];
  if (reference && reader.left) {
    nReused = reader.varint();
    finer = reader.float32(cutOff);
    if (!nReused || !isStep(finer)) {
      throw new CorruptStreamError(`${nReused} fields are reused, with vectors ${finer} as fine`);
    }
  }
  const isSound = stencilSize >= 1 && stencilSize <= MAX_STENCIL && isStep(step);
  if (!isSound || nLearned > MAX_LEARNED || reader.left) {
    throw new CorruptStreamError(
      `fields with stencils of ${stencilSize}, step ${step} and weights that follow ${nLearned} ` +
        `modes; ${reader.left} bytes are left over`,
    );
  }
  return { precision, reference, step, stencilSize, nLearned, nReused, finer, rests, restBits };
}

/** Runs of resting times, and the bits of their steps. */
function readRests(reader: ByteReader): [[number, number][], number] {
  const [bits, nRuns] = [reader.varint(), reader.varint()];
  const runs: [number, number][] = [];
  let end = 0;
  while (runs.length < nRuns) {
    const [gap, length] = [reader.varint(), reader.varint()];
    if (!gap || !length) {
      throw new CorruptStreamError(
        `a run of ${length} resting times follows ${gap} moving ones; both must be positive`,
      );
    }
    const start = end + gap;
    end = start + length;
    runs.push([start, end]);
  }
  if (!nRuns || bits > MAX_REST_BITS) {
    throw new CorruptStreamError(
      `${nRuns} runs of resting times are announced, with ${bits} bits; at least 1 run and at ` +
        `most ${MAX_REST_BITS} bits are allowed`,
    );
  }
  return [runs, bits];
}
