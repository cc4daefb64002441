// Number types of attributes and tracks, by their codes in include/meshreel.h.

import type { TrackInfo, TrackValues } from "../types.js";

type NumberArray = new (buffer: ArrayBuffer, start?: number, length?: number) => TrackValues;

/** Name and array type of each number type. */
export const NUMBER_TYPES: Readonly<Record<number, readonly [TrackInfo["numberType"], NumberArray]>> = {
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

/** Size of a number in bytes. */
export function bytesPerNumber(type: number): number {
  return type & 15;
}

/** Copy numbers from the memory of the library. */
export function copyNumbers(
  buffer: ArrayBuffer,
  type: number,
  start: number,
  length: number,
): TrackValues {
  const [, NumberArray] = NUMBER_TYPES[type];
  return new NumberArray(buffer.slice(start, start + length * bytesPerNumber(type)));
}
