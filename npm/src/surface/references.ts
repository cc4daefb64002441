// References into a table; most are to the next new row, or repeat the last one.

import type { Core } from "../core/core.js";
import { CorruptStreamError } from "../errors.js";
import { decodeIntegers } from "../decode/integers.js";
import { ByteReader } from "../stream/byte_reader.js";

/** Kinds of references: the last row of the same place again, the next new row, a number. */
const AGAIN = 0;
const NEW = 1;
const ELSE = 2;

/**
 * The row that each item refers to; the caller checks their range.
 *
 * @param places - The place of each item, below `nPlaces`.
 * @throws CorruptStreamError where the bytes are not references of so many items.
 */
export function decodeReferences(
  core: Core,
  data: Uint8Array,
  places: ArrayLike<number>,
  nPlaces: number,
): Int32Array {
  const reader = new ByteReader(data);
  const nOthers = reader.varint();
  const nItems = places.length;
  if (nOthers > nItems) {
    throw new CorruptStreamError(`${nOthers} of ${nItems} references have a number`);
  }
  const hasCome = new Uint8Array(nPlaces);
  let nFirst = 0;
  for (let i = 0; i < nItems; i++) {
    nFirst += 1 - hasCome[places[i]];
    hasCome[places[i]] = 1;
  }
  const lengths = [nFirst, nItems - nFirst, nOthers];
  const [first, later, differences] = decodeIntegers(core, reader.rest(), lengths);

  const last = new Int32Array(nPlaces).fill(-1); // the item before of each place
  const rows = new Int32Array(nItems);
  let [nextFirst, nextLater, nextNew, nextOther, other] = [0, 0, 0, 0, 0];
  for (let i = 0; i < nItems; i++) {
    const before = last[places[i]];
    const kind = before < 0 ? first[nextFirst++] : later[nextLater++];
    last[places[i]] = i;
    if (kind === AGAIN) {
      if (before < 0) {
        throw new CorruptStreamError("a reference repeats the last of its place, which has none");
      }
      rows[i] = rows[before];
    } else if (kind === NEW) {
      rows[i] = nextNew++;
    } else if (kind === ELSE) {
      if (nextOther === nOthers) throw wrongCount();
      other += differences[nextOther++];
      rows[i] = other;
    } else {
      throw new CorruptStreamError("a reference is of an unknown kind");
    }
  }
  if (nextOther !== nOthers) throw wrongCount();
  return rows;
}

function wrongCount(): CorruptStreamError {
  return new CorruptStreamError("there are not as many references with a number as announced");
}
