// Blocks without their fields: those are where they are summed up, on the GPU or the CPU.

import type { BlockFields } from "../types.js";

/** What of a block stays with the playing. */
export interface HeldBlock extends Omit<BlockFields, "fields"> {
  /** The mean of the weights over its frames: nModes x 3. */
  readonly meanWeights: Float32Array;
}

/** The block without its fields. */
export function withoutFields(block: BlockFields): HeldBlock {
  const { fields: _, ...rest } = block;
  return { ...rest, meanWeights: meanWeights(block) };
}

function meanWeights({ weights, nModes, nFrames }: BlockFields): Float32Array {
  const sums = new Float64Array(3 * nModes);
  weights.forEach((weight, i) => (sums[i % sums.length] += weight));
  return Float32Array.from(sums, (sum) => sum / nFrames);
}

/** A picture: frame `t` of a block, or between that and frame `nextT` of the same or another. */
export interface Moment {
  readonly block: HeldBlock;
  readonly t: number;
  readonly next: HeldBlock;
  readonly nextT: number;
  /** 0: the frame, up to 1: the next one. */
  readonly fraction: number;
  /** Modes of each block that move; the others rest at their mean over the block. */
  readonly nMoving: number;
}

/** A block, and how much of each mode is there: nModes x 3. */
export interface Share {
  readonly block: HeldBlock;
  readonly weights: Float32Array;
}

/** What a picture is made of. */
export interface Picture {
  /** The sums of fields: of one block, or of the two that it lies between. */
  readonly shares: readonly Share[];
  /**
   * An offset of three numbers for some vertices. Blocks some modes of which rest have none.
   */
  readonly corrections: ReadonlyMap<number, readonly number[]>;
}

/** What the picture of a moment is made of. */
export function pictureOf(moment: Moment): Picture {
  return { shares: sharesOf(moment), corrections: correctionsOf(moment) };
}

function sharesOf({ block, t, next, nextT, fraction, nMoving }: Moment): Share[] {
  const here = weightsOf(block, t, 1 - fraction, nMoving);
  if (fraction === 0) return [{ block, weights: here }];
  const there = weightsOf(next, nextT, fraction, nMoving);
  if (block === next) return [{ block, weights: here.map((one, i) => one + there[i]) }];
  return [
    { block, weights: here },
    { block: next, weights: there },
  ];
}

function weightsOf(block: HeldBlock, t: number, share: number, nMoving: number): Float32Array {
  const { nModes, weights, meanWeights } = block;
  const resting = isWhole(block, nMoving) ? Infinity : 3 * nMoving;
  return weights
    .subarray(3 * nModes * t, 3 * nModes * (t + 1))
    .map((one, i) => share * (i < resting ? one : meanWeights[i]));
}

function isWhole({ nBlockModes }: HeldBlock, nMoving: number): boolean {
  return nMoving >= nBlockModes;
}

/** The mean of all vertices in a picture, without its corrections; from the centre of the file. */
export function middleOf({ shares }: Picture): [number, number, number] {
  const middle: [number, number, number] = [0, 0, 0];
  for (const { block, weights } of shares) {
    weights.forEach((weight, i) => {
      middle[i % 3] += weight * block.means[Math.floor(i / 3)];
    });
  }
  return middle;
}

function correctionsOf(moment: Moment): Map<number, number[]> {
  const { block, t, next, nextT, fraction, nMoving } = moment;
  const sums = new Map<number, number[]>();
  const add = (from: HeldBlock, frame: number, share: number) => {
    if (!isWhole(from, nMoving)) return;
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
