// How modes move: basis vectors over time.

import type { Core } from "../core/core.js";
import type { Scope } from "../core/heap.js";
import { int64s } from "../core/int64.js";
import { type CodingOrder, decodeFields } from "./fields.js";

/** Frames between the times that come first. */
const COARSEST = 4;
/** Columns whose time is a context neighbour of the same time. */
const COLUMNS_BEFORE = 2;

/**
 * The address of basis vectors of shape (C, T, K), of doubles, in the scope.
 *
 * @throws CorruptStreamError where the bytes are not those of so many.
 */
export function decodeBasis(
  core: Core,
  scope: Scope,
  data: Uint8Array,
  nModes: number,
  nColumns: number,
  nFrames: number,
): number {
  return core.during((inner) => {
    const nTimes = nColumns * nFrames;
    const order = (): CodingOrder => timeOrder(inner, nColumns, nFrames);
    const integers = decodeFields(core, inner, data, nModes, nTimes, order);
    const basis = scope.take(8 * nModes * nTimes);
    const counts = [BigInt(nColumns), BigInt(nFrames)] as const;
    const size = core.functions.reel_basis_memory(...counts) >>> 0;
    const memory = inner.take(size);
    const modes = BigInt(nModes);
    const result = core.functions.reel_basis(memory, size, integers, modes, ...counts, basis);
    core.checked(result, "basis vectors");
    return basis;
  });
}

/**
 * The order in which residuals of a mode are coded, with the context neighbours of each:
 * docs/format.md, "Passes by times".
 */
function timeOrder(scope: Scope, nAll: number, nFrames: number): CodingOrder {
  const columns: number[] = [];
  const passStarts = [0];
  const nearStarts = [0];
  const near: number[] = [];
  const addPass = (first: number, apart: number, offsets: readonly number[]): void => {
    for (let column = 0; column < nAll; column++) {
      for (let time = first; time < nFrames; time += apart) {
        columns.push(column * nFrames + time);
        for (const offset of offsets) {
          const other = time + offset;
          if (other >= 0 && other < nFrames) near.push(column * nFrames + other);
        }
        for (let before = Math.max(column - COLUMNS_BEFORE, 0); before < column; before++) {
          near.push(before * nFrames + time);
        }
        nearStarts.push(near.length);
      }
    }
    passStarts.push(columns.length);
  };
  addPass(0, COARSEST, [-COARSEST, -2 * COARSEST]);
  for (let half = COARSEST / 2; half >= 1; half /= 2) {
    addPass(half, 2 * half, [-half, half, -2 * half, -4 * half]);
  }
  return {
    nColumns: nAll * nFrames,
    columns: scope.put(Int32Array.from(columns)),
    nPasses: passStarts.length - 1,
    passStarts: scope.put(int64s(passStarts)),
    nearStarts: scope.put(int64s(nearStarts)),
    nNear: near.length,
    near: scope.put(Int32Array.from(near)),
  };
}
