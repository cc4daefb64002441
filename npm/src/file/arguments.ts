// Arguments of calls, checked before an engine is asked.

import type { Positions } from "../decode/frames.js";
import { InvalidInputError } from "../errors.js";
import type { TrackInfo } from "../types.js";

/** @throws InvalidInputError where there is no such number. */
export function requireNumber(what: string, number: number, count: number): void {
  if (!(Number.isInteger(number) && number >= 0 && number < count)) {
    throw new InvalidInputError(`there are ${what}s 0 to ${count - 1}; got ${what} ${number}`);
  }
}

/** @throws InvalidInputError where `into` is given, and of another type or length. */
export function requireFitting(
  into: Positions | undefined,
  numberType: TrackInfo["numberType"],
  length: number,
): void {
  if (!numberType.startsWith("float")) return; // whoever decodes it says more
  const kind = numberType === "float32" ? Float32Array : Float64Array;
  if (into && !(into instanceof kind && into.length === length)) {
    throw new InvalidInputError(`into must be a ${kind.name} of ${length} numbers`);
  }
}

/** The numbers, in `into` where that is given. */
export function filled(into: Positions | undefined, numbers: Positions): Positions {
  if (!into) return numbers;
  into.set(numbers);
  return into;
}
