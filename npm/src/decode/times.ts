// How modes move: basis vectors over time.

import type { Core } from "../core/core.js";
import type { Scope } from "../core/heap.js";
import { int64s } from "../core/int64.js";
import { CorruptStreamError } from "../errors.js";
import type { Layout } from "../stream/block_sections.js";
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
  layout: Pick<Layout, "rests" | "restBits">,
  reused: Reused | null,
): number {
  const rests = restingTimes(layout.rests, nFrames);
  return core.during((inner) => {
    const nTimes = nColumns * nFrames;
    const order = (): CodingOrder => timeOrder(inner, nColumns, nFrames, rests);
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
    const resting = rests.includes(1) ? inner.put(rests) : 0;
    const found = [integers, modes, ...counts, resting, BigInt(layout.restBits)] as const;
    const result = core.functions.reel_basis(memory, size, ...found, lengths, nReused, basis);
    core.checked(result, "basis vectors");
    return basis;
  });
}

/** A byte for each time, 1 where it rests. */
function restingTimes(runs: Layout["rests"], nFrames: number): Uint8Array {
  const found = new Uint8Array(nFrames);
  for (const [start, end] of runs) {
    if (end > nFrames) {
      throw new CorruptStreamError(`times up to ${end - 1} rest in a block of ${nFrames}`);
    }
    found.fill(1, start, end);
  }
  return found;
}

/**
 * The order in which residuals of a mode are coded, with the context neighbours of each:
 * docs/format.md, "Passes by times".
 *
 * @param rests - 1 for each time that rests.
 */
function timeOrder(
  scope: Scope,
  nAll: number,
  nFrames: number,
  rests: Uint8Array,
): CodingOrder {
  const columns: number[] = [];
  const passStarts = [0];
  const nearStarts = [0];
  const near: number[] = [];
  /** Adds a pass of some times, with the times of the same column that are near each. */
  const addPass = (times: readonly number[], nearTo: (time: number, i: number) => number[]): void => {
    for (let column = 0; column < nAll; column++) {
      times.forEach((time, i) => {
        columns.push(column * nFrames + time);
        for (const other of nearTo(time, i)) near.push(column * nFrames + other);
        for (let before = Math.max(column - COLUMNS_BEFORE, 0); before < column; before++) {
          near.push(before * nFrames + time);
        }
        nearStarts.push(near.length);
      });
    }
    passStarts.push(columns.length);
  };
  const all = Array.from(rests.keys());
  const moving = all.filter((time) => !rests[time]);
  const addLevel = (first: number, apart: number, offsets: readonly number[]): void => {
    const times = moving.filter((_, place) => place % apart === first);
    addPass(times, (_, i) => {
      const places = offsets.map((offset) => first + i * apart + offset);
      return places.filter((place) => place in moving).map((place) => moving[place]);
    });
  };
  addLevel(0, COARSEST, [-COARSEST, -2 * COARSEST]);
  for (let half = COARSEST / 2; half >= 1; half /= 2) {
    addLevel(half, 2 * half, [-half, half, -2 * half, -4 * half]);
  }
  if (moving.length < nFrames) {
    const resting = all.filter((time) => rests[time]);
    addPass(resting, (time) => [time - 1, time - 2].filter((other) => rests[other]));
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
