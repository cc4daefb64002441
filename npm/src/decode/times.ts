// How modes move: basis vectors over time.

import type { Core } from "../core/core.js";
import type { Scope } from "../core/heap.js";
import { int64s } from "../core/int64.js";
import { type CodingOrder, decodeFields } from "./fields.js";

/** Frames between the times that come first. */
const COARSEST = 4;
/** Columns whose time is a context neighbour of the same time. */
const COLUMNS_BEFORE = 2;

/** Fields of a key block that move in another. */
export interface Reused {
  /** Address of the values of the key block, of shape (V, K). */
  readonly values: number;
  readonly nVerts: number;
  readonly nModes: number;
  /** The first so many of them move. */
  readonly nReused: number;
  readonly finer: number;
}

/**
 * The address of basis vectors of shape (C, T, K), of doubles, in the scope. Each has the length 1
 * (or 0), but not those of fields that are reused.
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
  reused: Reused | null,
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
    const nReused = BigInt(reused?.nReused ?? 0);
    const lengths = inner.take(8 * Number(nReused));
    if (reused) {
      const of = [BigInt(reused.nVerts), BigInt(reused.nModes), nReused] as const;
      core.functions.reel_lengths(reused.values, ...of, reused.finer, lengths);
    }
    const found = [integers, modes, ...counts, lengths, nReused, basis] as const;
    const result = core.functions.reel_basis(memory, size, ...found);
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
