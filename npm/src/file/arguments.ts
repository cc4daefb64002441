// Checks of arguments, made before an engine is called.

import { InvalidInputError } from "../errors.js";
import type { Positions, TrackInfo, TrackValues } from "../types.js";

/** @throws InvalidInputError if an index is not an integer in 0..count-1. */
export function requireIndex(what: string, index: number, count: number): void {
  if (!(Number.isInteger(index) && index >= 0 && index < count)) {
    throw new InvalidInputError(`${what} must be an integer from 0 to ${count - 1}; got ${index}`);
  }
}

/** @throws InvalidInputError if `into` is defined and has another number type or length. */
export function requireCompatible(
  into: TrackValues | undefined,
  numberType: TrackInfo["numberType"],
  length: number,
): void {
  const prefix = /int64/.test(numberType) ? "Big" : "";
  const arrayType = `${prefix}${numberType[0].toUpperCase()}${numberType.slice(1)}Array`;
  if (into && (into[Symbol.toStringTag] !== arrayType || into.length !== length)) {
    throw new InvalidInputError(`into must be a ${arrayType} of length ${length}`);
  }
}

/** Copy numbers to `into` if it is defined; returns the array that holds them. */
export function copyInto<Numbers extends TrackValues>(
  into: Numbers | undefined,
  numbers: Numbers,
): Numbers {
  if (!into) return numbers;
  (into as Positions).set(numbers as Positions);
  return into;
}
