// Checks of arguments, made before an engine is called.

import { InvalidInputError } from "../errors.js";

/** @throws InvalidInputError if an index is not an integer in 0..count-1. */
export function requireIndex(what: string, index: number, count: number): void {
  if (!(Number.isInteger(index) && index >= 0 && index < count)) {
    throw new InvalidInputError(`${what} must be an integer from 0 to ${count - 1}; got ${index}`);
  }
}
