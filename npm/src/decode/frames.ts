// Positions of frames, and values of tracks, to the same bit as everywhere.

import type { Core } from "../core/core.js";
import { int64s } from "../core/int64.js";
import { CorruptStreamError, InvalidInputError } from "../errors.js";
import type { DecodedBlock } from "./decoded_block.js";

/** Positions, x, y and z of each vertex, or values of a track; of the number type of the file. */
export type Positions = Float32Array | Float64Array;

/** How numbers go out: their type, and scale and origins for what is decoded. */
export interface Placement {
  /** Bytes of a number. */
  readonly vertexType: 4 | 8;
  readonly scale: number;
  /** Of each column. */
  readonly origin: readonly number[];
}

/**
 * Positions of a frame, of shape (V, 3), in model units; as `valuesOf`.
 *
 * @throws CorruptStreamError where positions are beyond all numbers.
 */
export function frameOf(
  core: Core,
  placement: Placement,
  block: DecodedBlock,
  time: number,
  into?: Positions,
): Positions {
  const found = valuesOf(core, placement, block, time, into);
  requireFinite(found, block);
  return found;
}

/**
 * What is decoded of a frame, of shape (V, C), in model units.
 *
 * @param time - Number of the frame within the block.
 * @param into - Is filled and returned where it is given; of the number type of the file.
 * @throws InvalidInputError where there is no such frame, or `into` is of another type or length.
 */
export function valuesOf(
  core: Core,
  { vertexType, scale, origin }: Placement,
  block: DecodedBlock,
  time: number,
  into?: Positions,
): Positions {
  const { nVerts, nColumns, nModes, nFrames, layout, basis, corrections } = block;
  if (!(Number.isInteger(time) && time >= 0 && time < nFrames)) {
    throw new InvalidInputError(`block ${block.number} has ${nFrames} frames; got frame ${time}`);
  }
  const length = nColumns * nVerts;
  const kind = vertexType === 4 ? Float32Array : Float64Array;
  const out = into ?? new kind(length);
  if (!(out instanceof kind) || out.length !== length) {
    throw new InvalidInputError(`into must be a ${kind.name} of ${length} numbers`);
  }
  const packed = block.packedFields(core);
  core.during((scope) => {
    const vectors = new Float64Array(nColumns * nModes);
    for (let axis = 0; axis < nColumns; axis++) {
      const start = (axis * nFrames + time) * nModes;
      vectors.set(basis.subarray(start, start + nModes), axis * nModes);
    }
    const [first, end] = corrections.starts.subarray(time, time + 2);
    const isMoved = end > first;
    const positions = scope.take(vertexType * length);
    const [columns, modes] = [BigInt(nColumns), BigInt(nModes)];
    const size = core.functions.reel_frames_memory(columns, modes, 1n) >>> 0;
    const result = core.functions.reel_frames(
      scope.take(size),
      size,
      scope.put(vectors),
      packed,
      BigInt(layout.precision),
      columns,
      1n,
      modes,
      BigInt(nVerts),
      scope.put(new Int32Array(1)),
      1n,
      isMoved ? scope.put(int64s([0, end - first])) : 0,
      isMoved ? scope.put(corrections.vertices.subarray(first, end)) : 0,
      isMoved ? scope.put(corrections.moves.subarray(nColumns * first, nColumns * end)) : 0,
      scope.put(Float64Array.of(scale, ...origin)),
      BigInt(vertexType),
      positions,
    );
    core.checked(result, "frames");
    out.set(vertexType === 4 ? core.float32s(positions, length) : core.float64s(positions, length));
  });
  return out;
}

/** A decoded normal that is shorter is that of a place that has none. */
const LEAST_LENGTH = 0.5;

/** Divides normals by their length; those that are none become 0. Gives back what it got. */
export function ofUnitLength(normals: Positions): Positions {
  for (let at = 0; at < normals.length; at += 3) {
    const [x, y, z] = [normals[at], normals[at + 1], normals[at + 2]];
    const length = Math.sqrt(x * x + y * y + z * z);
    const isThere = length >= LEAST_LENGTH;
    normals[at] = isThere ? x / length : 0;
    normals[at + 1] = isThere ? y / length : 0;
    normals[at + 2] = isThere ? z / length : 0;
  }
  return normals;
}

/**
 * Refuses numbers that no position can be.
 *
 * @throws CorruptStreamError where one is not finite.
 */
export function requireFinite(
  numbers: Positions,
  { start, nFrames }: Pick<DecodedBlock, "start" | "nFrames">,
): void {
  let sum = 0;
  for (let i = 0; i < numbers.length; i++) sum += numbers[i] - numbers[i]; // NaN if it is not
  if (sum !== 0) {
    throw new CorruptStreamError(
      `frames ${start}:${start + nFrames} decode to positions beyond all numbers`,
    );
  }
}
