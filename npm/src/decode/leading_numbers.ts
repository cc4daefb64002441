// Numbers of a stream before its first block: what is promised, and when it starts.

import { CorruptStreamError } from "../errors.js";
import { ByteReader } from "../stream/byte_reader.js";
import { Section } from "../stream/layout.js";
import type { StoredSection } from "../stream/sections.js";

/**
 * The largest displacement that the encoder promises, in percent of the diagonal; null without one.
 *
 * @throws CorruptStreamError where it is not a positive number.
 */
export function readPromise(leading: readonly StoredSection[]): number | null {
  const payload = firstOf(leading, Section.PROMISE);
  if (!payload) return null;
  if (payload.length !== 8) {
    throw new CorruptStreamError(`a promise has 8 bytes; this one has ${payload.length}`);
  }
  const percent = new ByteReader(payload).float64("");
  if (!(percent > 0 && percent < Infinity)) {
    throw new CorruptStreamError(`a maximum error of ${percent} is promised`);
  }
  return percent;
}

/**
 * Time of the first frame in seconds; 0 where it is not said.
 *
 * @throws CorruptStreamError where it is not one finite number.
 */
export function readStart(leading: readonly StoredSection[]): number {
  const payload = firstOf(leading, Section.START);
  if (!payload) return 0;
  if (payload.length !== 8) {
    throw new CorruptStreamError(`the start has ${payload.length} bytes; 8 are needed`);
  }
  const startS = new ByteReader(payload).float64("");
  if (!Number.isFinite(startS)) {
    throw new CorruptStreamError(`the start must be finite; got ${startS}`);
  }
  return startS;
}

function firstOf(leading: readonly StoredSection[], id: number): Uint8Array | undefined {
  return leading.find((section) => section.id === id)?.payload;
}
