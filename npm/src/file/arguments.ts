// Arguments of calls, checked before an engine is asked.

import { InvalidInputError } from "../errors.js";
import type { Positions, TrackInfo, TrackValues } from "../types.js";

/** @throws InvalidInputError where there is no such number. */
export function requireNumber(what: string, number: number, count: number): void {
  if (!(Number.isInteger(number) && number >= 0 && number < count)) {
    throw new InvalidInputError(`there are ${what}s 0 to ${count - 1}; got ${what} ${number}`);
  }
}

/** @throws InvalidInputError where `into` is given, and of another type or length. */
export function requireFitting(
  into: TrackValues | undefined,
  numberType: TrackInfo["numberType"],
  length: number,
): void {
  const big = /int64/.test(numberType) ? "Big" : "";
  const kind = `${big}${numberType[0].toUpperCase()}${numberType.slice(1)}Array`;
  if (into && (into[Symbol.toStringTag] !== kind || into.length !== length)) {
    throw new InvalidInputError(`into must be a ${kind} of ${length} numbers`);
  }
}

/** The numbers, in `into` where that is given. */
export function filled<Numbers extends TrackValues>(
  into: Numbers | undefined,
  numbers: Numbers,
): Numbers {
  if (!into) return numbers;
  (into as Positions).set(numbers as Positions);
  return into;
}
