// Sections of a stream: id, length, payload and a checksum of all three.

import {
  CorruptStreamError,
  SourceError,
  TruncatedStreamError,
  UnsupportedVersionError,
} from "../errors.js";
import { ByteReader } from "./byte_reader.js";
import { crc32 } from "./crc32.js";
import { OPTIONAL, isKnown, sectionName } from "./layout.js";

const MOST_HEAD_BYTES = 10;

/** A stretch of the bytes of a stream, and the byte at which it begins. */
export interface Stretch {
  readonly bytes: Uint8Array;
  readonly start: number;
}

/** A section as it is stored; its payload is a view of the bytes that were read. */
export interface StoredSection {
  readonly id: number;
  readonly payload: Uint8Array;
  /** Whether this build knows it; others are skipped. */
  readonly isKnown: boolean;
  /** Byte of the stream behind it. */
  readonly end: number;
}

/**
 * The section at a byte of a stream.
 *
 * @param stretch - Bytes of the stream that hold the section.
 * @param position - Byte of the stream at which the section begins.
 * @param end - Byte of the stream behind the last that may belong to it.
 * @throws TruncatedStreamError where the section ends behind `end`.
 * @throws CorruptStreamError where its checksum does not match.
 * @throws UnsupportedVersionError where it is required and unknown.
 * @throws SourceError where it is not in the stretch, but before `end`.
 */
export function readSection(stretch: Stretch, position: number, end: number): StoredSection {
  const behind = sectionEnd(stretch, position, end);
  const offset = position - stretch.start;
  if (behind === null || behind - stretch.start > stretch.bytes.length) {
    throw new SourceError(`the section at byte ${position} has not come whole`);
  }
  const bytes = stretch.bytes.subarray(offset, behind - stretch.start);
  const reader = new ByteReader(bytes, 1);
  const id = bytes[0];
  const length = reader.varint();
  const payload = bytes.subarray(reader.position, reader.position + length);
  reader.position += length;
  if (crc32(bytes.subarray(0, reader.position)) !== reader.uint32("")) {
    throw new CorruptStreamError(
      `the checksum of section ${sectionName(id)} at byte ${position} does not match; ` +
        "the file is damaged",
    );
  }
  if (!isKnown(id) && !(id & OPTIONAL)) {
    throw new UnsupportedVersionError(
      `section ${id} at byte ${position} is required and unknown to this build; upgrade meshreel`,
    );
  }
  return { id, payload, isKnown: isKnown(id), end: behind };
}

/**
 * The byte of the stream behind the section at `position`; null where so little of the section is
 * in the stretch that its length is not known. Throws as `readSection`, of what it can tell.
 */
export function sectionEnd(stretch: Stretch, position: number, end: number): number | null {
  if (position >= end) {
    throw new TruncatedStreamError(`the stream ends at byte ${end}, before its end marker`);
  }
  const offset = position - stretch.start;
  const head = stretch.bytes.subarray(
    offset,
    Math.min(offset + MOST_HEAD_BYTES, end - stretch.start),
  );
  const isWhole = head.length === Math.min(MOST_HEAD_BYTES, end - position);
  if (!isWhole && !head.subarray(1).some((byte) => byte < 0x80)) return null;
  const reader = new ByteReader(head, 1);
  const length = reader.varint();
  const behind = position + reader.position + length + 4;
  if (behind > end) {
    throw new TruncatedStreamError(
      `the stream ends at byte ${end}; section ${sectionName(head[0])} at byte ${position} ` +
        `needs ${behind - end} more bytes`,
    );
  }
  return behind;
}

/** All sections between two bytes of a stream that this build knows; throws as `readSection`. */
export function readSections(stretch: Stretch, start: number, end: number): StoredSection[] {
  const found: StoredSection[] = [];
  for (let position = start; position < end;) {
    const section = readSection(stretch, position, end);
    if (section.isKnown) found.push(section);
    position = section.end;
  }
  return found;
}
