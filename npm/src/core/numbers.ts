// Number types of attributes and tracks, by their codes in include/meshreel.h.

import type { TrackInfo, TrackValues } from "../types.js";

type Numbers = new (buffer: ArrayBuffer, start?: number, length?: number) => TrackValues;

/** Names, and arrays of such numbers. */
export const NUMBER_TYPES: Readonly<Record<number, readonly [TrackInfo["numberType"], Numbers]>> = {
  4: ["float32", Float32Array],
  8: ["float64", Float64Array],
  17: ["uint8", Uint8Array],
  18: ["uint16", Uint16Array],
  20: ["uint32", Uint32Array],
  24: ["uint64", BigUint64Array],
  33: ["int8", Int8Array],
  34: ["int16", Int16Array],
  36: ["int32", Int32Array],
  40: ["int64", BigInt64Array],
};

/** Bytes of a number of a type. */
export function sizeOf(type: number): number {
  return type & 15;
}

/** A copy of numbers in the memory of the library. */
export function numbersAt(
  buffer: ArrayBuffer,
  type: number,
  start: number,
  length: number,
): TrackValues {
  const [, Numbers] = NUMBER_TYPES[type];
  return new Numbers(buffer.slice(start, start + length * sizeOf(type)));
}
