// Tables of numbers, exactly: as multiples of a fraction, or as they are.

import type { Core } from "../core/core.js";
import type { Scope } from "../core/heap.js";
import { int64s } from "../core/int64.js";
import { findTwins } from "../decode/connectivity.js";
import { requireEnd } from "../decode/integers.js";
import { CorruptStreamError } from "../errors.js";
import { ByteReader } from "../stream/byte_reader.js";
import type { Attribute } from "../types.js";

/** Rows of numbers. */
export type Numbers = Attribute["values"];

/** Number types of values, in the order of their codes. */
export const NUMBER_TYPES = [Uint8Array, Int32Array, Float32Array, Float64Array] as const;

/** The type of a table. */
export type NumberType = (typeof NUMBER_TYPES)[number];

/** Rows at the corners of triangles, which say which rows are near each other. */
export type RowsOfTriangles = () => Int32Array;

const AS_THEY_ARE = 255;
const BY_BYTE = 10;
const BY_SHORT = 11;
const GRID = 64;
const MAX_GRID_BITS = 24;

const NOTHING = 0;
const ROW_BEFORE = 1;
const ALONG_FACES = 2;

/**
 * A table of values of an attribute; the caller bounds its size.
 *
 * @param along - What rows may be expected from, besides nothing and the row before; null where
 * there is none.
 * @throws CorruptStreamError where the bytes are not those of a table of this shape and type.
 */
export function decodeTable(
  core: Core,
  data: Uint8Array,
  nRows: number,
  width: number,
  type: NumberType,
  along: RowsOfTriangles | null,
): Numbers {
  const reader = new ByteReader(data);
  const cutOff = "a table of values ends inside its first two bytes";
  const [form, way] = reader.take(2, cutOff);
  const packed = reader.rest();
  if (way > (along ? ALONG_FACES : ROW_BEFORE)) {
    throw new CorruptStreamError(`rows are expected in way ${way}, which is unknown`);
  }
  const isFloat = type === Float32Array || type === Float64Array;
  const by = form === AS_THEY_ARE ? 1 : divisor(form);
  if (!by || (form !== AS_THEY_ARE && !isFloat)) {
    throw new CorruptStreamError(
      `a table of ${type.name} is written in form ${form}, which is unknown`,
    );
  }
  requireEnd(packed, "numbers");
  const coded = form === AS_THEY_ARE ? type : Int32Array;
  const numbers = core.during((scope) => {
    const expected = expectedRows(core, scope, way, nRows, along);
    return decodePatterns(core, scope, packed, nRows, width, coded, expected);
  });
  if (form === AS_THEY_ARE) return numbers;
  const values = new type(numbers.length);
  numbers.forEach((number, i) => (values[i] = number / by));
  return values;
}

/** By what integers of a form are divided; 0 where it is unknown. */
function divisor(form: number): number {
  if (form < BY_BYTE) return 10 ** form;
  if (form === BY_BYTE) return 255;
  if (form === BY_SHORT) return 65535;
  return form >= GRID && form <= GRID + MAX_GRID_BITS ? 2 ** (form - GRID) : 0;
}

/** In which order rows are coded, and from which others each is expected; see core/reel.h. */
interface Expected {
  readonly order: number;
  readonly starts: number;
  readonly triples: number;
}

function expectedRows(
  core: Core,
  scope: Scope,
  way: number,
  nRows: number,
  along: RowsOfTriangles | null,
): Expected {
  if (way === ALONG_FACES && along) return expectedAlong(core, scope, nRows, along());
  const order = Int32Array.from({ length: nRows }, (_, i) => i);
  const starts = new Float64Array(nRows + 1);
  const triples = new Int32Array(way === NOTHING ? 0 : 3 * nRows);
  if (way === ROW_BEFORE) {
    for (let i = 0; i < nRows; i++) {
      starts[i + 1] = i;
      triples.set([i, i, -1], 3 * i);
    }
  }
  return {
    order: scope.put(order),
    starts: scope.put(int64s(starts)),
    triples: scope.put(triples),
  };
}

function expectedAlong(core: Core, scope: Scope, nRows: number, rows: Int32Array): Expected {
  const nFaces = rows.length / 3;
  const faces = scope.put(rows);
  const twins = findTwins(core, scope, faces, nFaces, nRows);
  const found = {
    order: scope.take(4 * nRows),
    starts: scope.take(8 * (nRows + 1)),
    triples: scope.take(12 * (3 * nFaces + nRows)),
  };
  core.during((inner) => {
    const counts = [BigInt(nRows), BigInt(nFaces)] as const;
    const size = core.functions.reel_expected_memory(...counts) >>> 0;
    const result = core.functions.reel_expected_find(
      inner.take(size),
      size,
      faces,
      twins,
      ...counts,
      found.order,
      found.starts,
      found.triples,
    );
    core.checked(result, "rows");
  });
  return found;
}

function decodePatterns(
  core: Core,
  scope: Scope,
  data: Uint8Array,
  nRows: number,
  width: number,
  type: NumberType,
  { order, starts, triples }: Expected,
): Numbers {
  const size = type.BYTES_PER_ELEMENT;
  const values = scope.take(size * nRows * width);
  const memorySize = core.functions.reel_patterns_memory(BigInt(width)) >>> 0;
  const result = core.functions.reel_patterns_decode(
    scope.take(memorySize),
    memorySize,
    scope.put(data),
    data.length,
    values,
    BigInt(nRows),
    BigInt(width),
    BigInt(size),
    BigInt(type === Float32Array || type === Float64Array),
    order,
    starts,
    triples,
  );
  core.checked(result, "numbers");
  return new type(core.bytes(values, size * nRows * width).slice().buffer);
}
