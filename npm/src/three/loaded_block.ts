// Blocks without their fields, which only the backend holds.

import type { BlockFields } from "../types.js";

/** A block without its fields. */
export type LoadedBlock = Omit<BlockFields, "fields">;

/** Remove the fields of a block. */
export function withoutFields({ fields: _, ...block }: BlockFields): LoadedBlock {
  return block;
}

/** A time: frame `t` of a block, or between it and frame `nextT` of the same or the next block. */
export interface Moment {
  readonly block: LoadedBlock;
  readonly t: number;
  readonly next: LoadedBlock;
  readonly nextT: number;
  /** Interpolation weight of the next frame, in [0, 1). */
  readonly fraction: number;
}

/** A block and the weights of its modes: nModes x 3. */
export interface WeightedBlock {
  readonly block: LoadedBlock;
  readonly weights: Float32Array;
}

/** The operands of a picture. */
export interface Picture {
  /** One block, or the two blocks between which the picture lies. */
  readonly blocks: readonly WeightedBlock[];
  /** Offsets of corrected vertices, three numbers each. */
  readonly corrections: ReadonlyMap<number, readonly number[]>;
}

/** Compute the operands of the picture at a moment. */
export function composePicture(moment: Moment): Picture {
  return { blocks: weightedBlocks(moment), corrections: blendCorrections(moment) };
}

function weightedBlocks({ block, t, next, nextT, fraction }: Moment): WeightedBlock[] {
  const weights = frameWeights(block, t, 1 - fraction);
  if (fraction === 0) return [{ block, weights }];
  const nextWeights = frameWeights(next, nextT, fraction);
  if (block === next) return [{ block, weights: weights.map((weight, i) => weight + nextWeights[i]) }];
  return [
    { block, weights },
    { block: next, weights: nextWeights },
  ];
}

/** Return the weights of a frame, times a factor. */
function frameWeights({ weights, nModes }: LoadedBlock, t: number, factor: number): Float32Array {
  return weights.subarray(3 * nModes * t, 3 * nModes * (t + 1)).map((weight) => factor * weight);
}

/** Blend the corrections of a moment. */
function blendCorrections({ block, t, next, nextT, fraction }: Moment): Map<number, number[]> {
  const offsets = new Map<number, number[]>();
  const add = (from: LoadedBlock, frame: number, factor: number) => {
    for (let i = from.correctionStarts[frame]; i < from.correctionStarts[frame + 1]; i++) {
      const vertex = from.correctionVertices[i];
      const sum = offsets.get(vertex) ?? [0, 0, 0];
      offsets.set(vertex, sum.map((offset, axis) => offset + factor * from.correctionOffsets[3 * i + axis]));
    }
  };
  add(block, t, 1 - fraction);
  if (fraction > 0) add(next, nextT, fraction);
  return offsets;
}

/** Mean of all vertices in a picture, relative to the center of the file; ignores corrections. */
export function meanPosition({ blocks }: Picture): [number, number, number] {
  const mean: [number, number, number] = [0, 0, 0];
  for (const { block, weights } of blocks) {
    weights.forEach((weight, i) => {
      mean[i % 3] += weight * block.means[Math.floor(i / 3)];
    });
  }
  return mean;
}
