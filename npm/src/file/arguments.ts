// Checks of arguments.

import { InvalidInputError } from "../errors.js";
import type { TrackValues } from "../types.js";

/** @throws InvalidInputError if an index is not an integer in 0..count-1. */
export function requireIndex(what: string, index: number, count: number): void {
  if (!(Number.isInteger(index) && index >= 0 && index < count)) {
    throw new InvalidInputError(`${what} must be an integer from 0 to ${count - 1}; got ${index}`);
  }
}

/**
 * Return decoded values: in `target` if there is one.
 *
 * @throws InvalidInputError if `target` has another type or length.
 */
export function valuesIn(target: TrackValues | null | undefined, values: TrackValues): TrackValues {
  if (!target) return values;
  const describe = (array: TrackValues): string =>
    `${Object.prototype.toString.call(array).slice(8, -1)} of length ${array.length ?? "undefined"}`;
  if (describe(target) !== describe(values)) {
    throw new InvalidInputError(`the array to reuse must be a ${describe(values)}; got a ${describe(target)}`);
  }
  target.set(values as never); // both are of one type
  return target;
}
