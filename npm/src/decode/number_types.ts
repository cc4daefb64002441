// Number types of tracks, by their codes in streams.

import type { TrackValues } from "../types.js";

/** Kinds of numbers, as the core has them. */
const UNSIGNED_INTEGERS = 0;
const SIGNED_INTEGERS = 1;
export const FLOATS = 2;

export interface NumberType {
  /** Such as "uint8". */
  readonly name: string;
  readonly sizeBytes: number;
  /** The kind, for the core. */
  readonly type: number;
  /** Numbers in memory. */
  view(buffer: ArrayBuffer, start: number, length: number): TrackValues;
}

type ArrayType = new (buffer: ArrayBuffer, start: number, length: number) => TrackValues;

function numberType(name: string, sizeBytes: number, type: number, array: ArrayType): NumberType {
  return { name, sizeBytes, type, view: (...given) => new array(...given) };
}

export const BYTES = numberType("uint8", 1, UNSIGNED_INTEGERS, Uint8Array);

/** Added to the code of a float: that of signed integers of as many bytes. */
const SIGNED = 32;

/** Signed integers of as many bytes as a float has. */
export function integersOf({ sizeBytes }: NumberType): NumberType {
  return NUMBER_TYPES.get(SIGNED + sizeBytes)!;
}

/** Number types by their codes; others are unknown. */
export const NUMBER_TYPES: ReadonlyMap<number, NumberType> = new Map([
  [4, numberType("float32", 4, FLOATS, Float32Array)],
  [8, numberType("float64", 8, FLOATS, Float64Array)],
  [17, BYTES],
  [18, numberType("uint16", 2, UNSIGNED_INTEGERS, Uint16Array)],
  [20, numberType("uint32", 4, UNSIGNED_INTEGERS, Uint32Array)],
  [24, numberType("uint64", 8, UNSIGNED_INTEGERS, BigUint64Array)],
  [33, numberType("int8", 1, SIGNED_INTEGERS, Int8Array)],
  [34, numberType("int16", 2, SIGNED_INTEGERS, Int16Array)],
  [36, numberType("int32", 4, SIGNED_INTEGERS, Int32Array)],
  [40, numberType("int64", 8, SIGNED_INTEGERS, BigInt64Array)],
]);
