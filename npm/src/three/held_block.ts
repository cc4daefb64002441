// Blocks without their fields: those are where they are summed up, on the GPU or the CPU.

import type { BlockFields } from "../types";

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

/** Offsets of vertices, each of which comes once; three numbers for each. */
export interface Corrections {
  readonly vertices: Uint32Array;
  readonly offsets: Float32Array;
}

/** The sums of fields that make the picture: of one block, or of the two that it lies between. */
export function sharesOf(moment: Moment): Share[] {
  const { block, t, next, nextT, fraction } = moment;
  const here = weightsOf(block, t);
  if (fraction === 0) return [{ block, weights: here }];
  const there = weightsOf(next, nextT);
  if (block === next) {
    const weights = here.map((weight, i) => (1 - fraction) * weight + fraction * there[i]);
    return [{ block, weights }];
  }
  return [
    { block, weights: here.map((weight) => (1 - fraction) * weight) },
    { block: next, weights: there.map((weight) => fraction * weight) },
  ];
}

function weightsOf({ nModes, weights }: HeldBlock, t: number): Float32Array {
  return weights.subarray(3 * nModes * t, 3 * nModes * (t + 1));
}

/** The corrections of the picture. */
export function correctionsOf(moment: Moment): Corrections {
  const here = ownCorrections(moment.block, moment.t);
  if (moment.fraction === 0) return here;
  const there = ownCorrections(moment.next, moment.nextT);
  return blend(here, 1 - moment.fraction, there, moment.fraction);
}

function ownCorrections(block: HeldBlock, t: number): Corrections {
  const [start, end] = [block.correctionStarts[t], block.correctionStarts[t + 1]];
  return {
    vertices: block.correctionVertices.subarray(start, end),
    offsets: block.correctionOffsets.subarray(3 * start, 3 * end),
  };
}

function blend(first: Corrections, a: number, second: Corrections, b: number): Corrections {
  const most = first.vertices.length + second.vertices.length;
  const vertices = new Uint32Array(most);
  const offsets = new Float32Array(3 * most);
  const places = new Map<number, number>();
  const add = (from: Corrections, share: number) => {
    for (let i = 0; i < from.vertices.length; i++) {
      const vertex = from.vertices[i];
      const place = places.get(vertex) ?? places.size;
      places.set(vertex, place);
      vertices[place] = vertex;
      for (let axis = 0; axis < 3; axis++) {
        offsets[3 * place + axis] += share * from.offsets[3 * i + axis];
      }
    }
  };
  add(first, a);
  add(second, b);
  return {
    vertices: vertices.subarray(0, places.size),
    offsets: offsets.subarray(0, 3 * places.size),
  };
}
