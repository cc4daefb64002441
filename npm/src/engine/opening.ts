// A stream whose bytes are read as they are needed: first header and index, then what leads to the
// first block.

import { requireMesh } from "../decode/memory.js";
import { CorruptStreamError } from "../errors.js";
import { type Layout, readLayout } from "../stream/block_sections.js";
import { type Header, readHeader } from "../stream/header.js";
import { firstBlock, indexPayload, indexPosition, readIndex } from "../stream/index_section.js";
import { END_SIZE_BYTES, LONGEST_HEADER, Section, isOfBlock } from "../stream/layout.js";
import {
  type StoredSection,
  readSection,
  readSections,
  sectionEnd,
} from "../stream/sections.js";
import { type Stream, checkedStream, nTracks, readStream } from "../stream/stream.js";

/** The bytes `start` to `end - 1`, fewer where there are no more. */
export type Read = (start: number, end: number, signal: AbortSignal) => Promise<Uint8Array>;

/** What can be known of a stream before its end has come. */
export interface Beginning {
  readonly header: Header;
  readonly leading: readonly StoredSection[];
  /** Byte of the stream at which the first block begins. */
  readonly end: number;
  /** Of the fields of the first block. */
  readonly layout: Layout;
}

/** What is read at first: of most files the connectivity is in it, of small ones everything. */
const HEAD_BYTES = 65536;

/** What is read from the end: of most files the index is in it. */
const TAIL_BYTES = 4096;

/**
 * Header, sections before the first block and index of a stream. Where the index is missing or
 * damaged, all is read, and blocks are found section by section.
 *
 * @param size - Bytes of the file, null if that is not known.
 * @param hasRanges - Whether the end can be read before the rest.
 * @param memory - Bytes that decoding may take at once.
 * @param begin - Called while the end is on its way, where enough is here and seems to be sound.
 * @throws CorruptStreamError, TruncatedStreamError, UnsupportedVersionError as `readStream`;
 * SourceError from reading.
 */
export async function openStream(
  read: Read,
  size: number | null,
  hasRanges: boolean,
  signal: AbortSignal,
  memory: number,
  begin: (beginning: Beginning) => Promise<void>,
): Promise<Stream> {
  if (size !== null && hasRanges && size > HEAD_BYTES) {
    const head = await read(0, HEAD_BYTES, signal);
    const header = readHeader(head.subarray(0, LONGEST_HEADER));
    requireMesh(memory, header);
    try {
      const tail = read(size - TAIL_BYTES, size, signal);
      tail.catch(() => {}); // it is awaited below
      const beginning = beginningOf(head, header, size);
      if (beginning) await begin(beginning);
      return await openByIndex(read, head, header, size, await tail, signal, memory);
    } catch (error) {
      if (!(error instanceof CorruptStreamError)) throw error;
    }
  }
  return readStream(await read(0, size ?? Number.MAX_SAFE_INTEGER, signal), memory);
}

async function openByIndex(
  read: Read,
  head: Uint8Array,
  header: Header,
  size: number,
  end: Uint8Array,
  signal: AbortSignal,
  memory: number,
): Promise<Stream> {
  const { sizeBytes } = header;
  const tail = { start: size - TAIL_BYTES, bytes: end };
  const position = indexPosition(tail, sizeBytes, size);
  const isInTail = position >= tail.start && position < size - END_SIZE_BYTES;
  const rest = isInTail
    ? tail
    : { start: position, bytes: await read(Math.max(position, 0), size, signal) };
  const index = indexPayload(rest, position, sizeBytes, size);
  const first = firstBlock(index);
  const before =
    first <= head.length ? head : joined(head, await read(head.length, first, signal));
  const leading = readSections({ start: 0, bytes: before }, sizeBytes, first);
  const places = readIndex(index, position, nTracks(leading));
  return checkedStream(header, leading, places, size, true, memory);
}

/** What leads to the first block; null where it is not all here, or not sound: reading tells why. */
function beginningOf(head: Uint8Array, header: Header, size: number): Beginning | null {
  const stretch = { bytes: head, start: 0 };
  const leading: StoredSection[] = [];
  let blockStart = 0;
  try {
    for (let position = header.sizeBytes; ;) {
      const end = sectionEnd(stretch, position, size);
      if (end === null || end > head.length) return null;
      const section = readSection(stretch, position, size);
      if (section.id === Section.FIELDS) {
        return { header, leading, end: blockStart, layout: readLayout(section.payload) };
      }
      if (isOfBlock(section.id)) blockStart ||= position;
      else if (section.isKnown) leading.push(section);
      position = end;
    }
  } catch {
    return null;
  }
}

function joined(first: Uint8Array, second: Uint8Array): Uint8Array {
  const all = new Uint8Array(first.length + second.length);
  all.set(first);
  all.set(second, first.length);
  return all;
}
