// Blocks without their fields: those are where they are summed up, on the GPU or the CPU.

import type { BlockFields } from "../types.js";

/** What of a block stays with the playing. */
export type HeldBlock = Omit<BlockFields, "fields">;

/** The block without its fields. */
export function withoutFields(block: BlockFields): HeldBlock {
  const { fields: _, ...rest } = block;
  return rest;
}

/** A picture: frame `t` of a block, or between that and frame `nextT` of the same or another. */
export interface Moment {
  readonly block: HeldBlock;
  readonly t: number;
  readonly next: HeldBlock;
  readonly nextT: number;
  /** 0: the frame, up to 1: the next one. */
  readonly fraction: number;
}

/** A block, and how much of each mode is there: nModes x 3. */
export interface Share {
  readonly block: HeldBlock;
  readonly weights: Float32Array;
}

/** The sums of fields that make the picture: of one block, or of the two that it lies between. */
export function sharesOf({ block, t, next, nextT, fraction }: Moment): Share[] {
  const here = weightsOf(block, t, 1 - fraction);
  if (fraction === 0) return [{ block, weights: here }];
  const there = weightsOf(next, nextT, fraction);
  if (block === next) return [{ block, weights: here.map((one, i) => one + there[i]) }];
  return [
    { block, weights: here },
    { block: next, weights: there },
  ];
}

function weightsOf({ nModes, weights }: HeldBlock, t: number, share: number): Float32Array {
  return weights.subarray(3 * nModes * t, 3 * nModes * (t + 1)).map((one) => share * one);
}

/** The corrections of the picture: an offset of three numbers for some vertices. */
export function correctionsOf(moment: Moment): Map<number, number[]> {
  const { block, t, next, nextT, fraction } = moment;
  const sums = new Map<number, number[]>();
  const add = (from: HeldBlock, frame: number, share: number) => {
    for (let i = from.correctionStarts[frame]; i < from.correctionStarts[frame + 1]; i++) {
      const vertex = from.correctionVertices[i];
      const sum = sums.get(vertex) ?? [0, 0, 0];
      sums.set(
        vertex,
        sum.map((one, axis) => one + share * from.correctionOffsets[3 * i + axis]),
      );
    }
  };
  add(block, t, 1 - fraction);
  if (fraction > 0) add(next, nextT, fraction);
  return sums;
}
