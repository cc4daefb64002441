// The parts of a stream: header, sections before the first block, places of the blocks.

import { DEFAULT_MEMORY, requireMesh } from "../decode/memory.js";
import { CorruptStreamError } from "../errors.js";
import { counted } from "./counting.js";
import { type Header, readHeader } from "./header.js";
import {
  type BlockPlace,
  firstBlock,
  indexPayload,
  indexPosition,
  readIndex,
} from "./index_section.js";
import { LONGEST_HEADER, Section, sectionName } from "./layout.js";
import { Scan } from "./scan.js";
import { type StoredSection, readSections } from "./sections.js";

/** What is known of a stream before a block is read. */
export interface Stream {
  readonly header: Header;
  /** Sections before the first block. */
  readonly leading: readonly StoredSection[];
  /** Positions of all complete blocks. */
  readonly places: readonly BlockPlace[];
  /** First frame of each complete block, and the number of all frames. */
  readonly starts: readonly number[];
  readonly sizeBytes: number;
  /** Bytes that decoding may take at once. */
  readonly memory: number;
}

/**
 * A stream that is in memory as a whole. Where the index is missing or damaged, blocks are found
 * section by section, up to the last that is complete.
 *
 * @throws CorruptStreamError, TruncatedStreamError where the header is damaged, or no block is
 * complete.
 * @param memory - Bytes that decoding may take at once.
 * @throws UnsupportedVersionError where a newer build is needed.
 * @throws MemoryLimitError where the mesh is larger than allowed.
 */
export function readStream(bytes: Uint8Array, memory = DEFAULT_MEMORY): Stream {
  const header = readHeader(bytes.subarray(0, LONGEST_HEADER));
  try {
    const whole = { bytes, start: 0 };
    const position = indexPosition(whole, header.sizeBytes, bytes.length);
    const index = indexPayload(whole, position, header.sizeBytes, bytes.length);
    const leading = readSections(whole, header.sizeBytes, firstBlock(index));
    const places = readIndex(index, position, nTracks(leading));
    return checkedStream(header, leading, places, bytes.length, true, memory);
  } catch (error) {
    if (!(error instanceof CorruptStreamError)) throw error;
  }
  const scan = new Scan(header.sizeBytes);
  scan.advance(bytes, true);
  if (scan.damage && !scan.places.length) throw scan.damage;
  return checkedStream(header, scan.leading, scan.places, bytes.length, !scan.damage, memory);
}

/**
 * A stream of its parts.
 *
 * @param sizeBytes - Of the whole stream.
 * @param isWhole - Whether it has its end marker.
 * @param memory - Bytes that decoding may take at once.
 * @throws CorruptStreamError where it holds no block, or other frames than the header announces.
 * @throws MemoryLimitError where the mesh is larger than allowed.
 */
export function checkedStream(
  header: Header,
  leading: readonly StoredSection[],
  places: readonly BlockPlace[],
  sizeBytes: number,
  isWhole: boolean,
  memory = DEFAULT_MEMORY,
): Stream {
  if (!places.length) throw new CorruptStreamError("the stream holds no block of frames");
  const starts = [0];
  for (const place of places) starts.push(starts[starts.length - 1] + place.nFrames);
  const nFrames = starts[places.length];
  const { nFrames: announced } = header;
  if (announced && isWhole && nFrames !== announced) {
    throw new CorruptStreamError(
      `the blocks hold ${counted(nFrames, "frame")}; the header announces ${announced}`,
    );
  }
  requireMesh(memory, header);
  return { header, leading, places, starts, sizeBytes, memory };
}

/** Tracks of each block, by the sections before the first. */
export function nTracks(leading: readonly StoredSection[]): number {
  return 1 + leading.filter((section) => section.id === Section.TRACK).length;
}

/**
 * The payload of the only section of an id before the first block.
 *
 * @throws CorruptStreamError where there is none, or more than one.
 */
export function onlySection(leading: readonly StoredSection[], id: number): Uint8Array {
  const found = leading.filter((section) => section.id === id);
  if (found.length !== 1) {
    throw new CorruptStreamError(
      `the stream has ${found.length} sections ${sectionName(id)}; exactly 1 is allowed`,
    );
  }
  return found[0].payload;
}
