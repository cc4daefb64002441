// The index of a stream: positions of its blocks, for random access.

import { CorruptStreamError } from "../errors.js";
import { ByteReader } from "./byte_reader.js";
import { END_SIZE_BYTES, Section } from "./layout.js";
import { type Stretch, readSection } from "./sections.js";

/** Position and size of a block of frames in a stream. */
export interface BlockPlace {
  readonly nFrames: number;
  /** Byte of the stream at which its first section begins. */
  readonly position: number;
  /** Bytes of the sections of each track, the positions first. */
  readonly sizes: readonly number[];
}

/** Bytes of all sections of a block. */
export function blockSizeBytes(place: BlockPlace): number {
  return place.sizes.reduce((sum, size) => sum + size, 0);
}

/**
 * The byte at which the index begins, from the end of a stream.
 *
 * @param stretch - Holds the last `END_SIZE_BYTES` bytes of the stream.
 * @param start - Byte behind the header.
 * @param sizeBytes - Of the stream.
 * @throws CorruptStreamError where the end does not say it.
 */
export function indexPosition(stretch: Stretch, start: number, sizeBytes: number): number {
  const end = readSection(stretch, Math.max(start, sizeBytes - END_SIZE_BYTES), sizeBytes);
  if (end.id !== Section.END || end.payload.length !== 8) {
    throw new CorruptStreamError("the stream does not end with an end marker that has an index");
  }
  const { buffer, byteOffset } = end.payload;
  return Number(new DataView(buffer, byteOffset).getBigUint64(0, true));
}

/**
 * The payload of the index.
 *
 * @param stretch - Holds the bytes of the stream from `position` on.
 * @param position - As `indexPosition` says.
 * @param start - Byte behind the header.
 * @param sizeBytes - Of the stream.
 * @throws CorruptStreamError where there is none, or it is damaged.
 */
export function indexPayload(
  stretch: Stretch,
  position: number,
  start: number,
  sizeBytes: number,
): Uint8Array {
  const section = position >= start ? readSection(stretch, position, sizeBytes) : null;
  if (section?.id !== Section.INDEX) {
    throw new CorruptStreamError(`there is no index at byte ${position}`);
  }
  const first = firstBlock(section.payload);
  if (!(start <= first && first <= position)) {
    throw new CorruptStreamError("the index lists blocks inside the header");
  }
  return section.payload;
}

/** Byte of the stream at which the first block begins, from the payload of the index. */
export function firstBlock(payload: Uint8Array): number {
  return new ByteReader(payload).varint();
}

/**
 * Positions of the blocks, from the payload of the index.
 *
 * @param end - Byte at which the section of the index begins.
 * @param nTracks - Tracks of each block, the positions among them.
 * @throws CorruptStreamError where blocks or tracks are empty, or do not end at `end`.
 */
export function readIndex(payload: Uint8Array, end: number, nTracks: number): BlockPlace[] {
  const reader = new ByteReader(payload);
  let position = reader.varint();
  const nBlocks = reader.varint();
  const places: BlockPlace[] = [];
  for (let i = 0; i < Math.min(nBlocks, payload.length); i++) {
    const nFrames = reader.varint();
    const sizes = Array.from({ length: nTracks }, () => reader.varint());
    places.push({ nFrames, position, sizes });
    position += blockSizeBytes(places[i]);
  }
  const isWhole = places.length > 0 && places.length === nBlocks && !reader.left;
  const areFilled = places.every((one) => one.nFrames && one.sizes.every((size) => size));
  if (!isWhole || position !== end || !areFilled) {
    throw new CorruptStreamError(
      `the index lists ${nBlocks} blocks up to byte ${position}; they should end at byte ${end}`,
    );
  }
  return places;
}
