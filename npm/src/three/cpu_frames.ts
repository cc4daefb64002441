// Computes positions and normals on the CPU.

import type { LoadedBlock, Picture } from "./loaded_block.js";

/** Returns the fields of a block: nModes x nVerts. */
export type FieldsOf = (block: LoadedBlock) => Int16Array;

/**
 * Compute the positions of a picture plus `shift`, three numbers per vertex in model units.
 *
 * @param into - receives the positions and is returned
 */
export function computePositions(
  { blocks: shares, corrections }: Picture,
  fieldsOf: FieldsOf,
  shift: readonly number[],
  into: Float32Array,
): Float32Array {
  into.fill(0);
  for (const { block, weights } of shares) {
    addFields(fieldsOf(block), weights, into);
  }
  for (const [vertex, offset] of corrections) {
    for (let axis = 0; axis < 3; axis++) into[3 * vertex + axis] += offset[axis];
  }
  for (let i = 0; i < into.length; i++) into[i] += shift[i % 3];
  return into;
}

function addFields(fields: Int16Array, weights: Float32Array, into: Float32Array): void {
  const nVerts = into.length / 3;
  for (let mode = 0; 3 * mode < weights.length; mode++) {
    const [x, y, z] = weights.subarray(3 * mode, 3 * mode + 3);
    if (x === 0 && y === 0 && z === 0) continue; // most weights of exact tracks are 0
    const from = mode * nVerts;
    for (let vertex = 0, to = 0; vertex < nVerts; vertex++, to += 3) {
      const field = fields[from + vertex];
      into[to] += x * field;
      into[to + 1] += y * field;
      into[to + 2] += z * field;
    }
  }
}

/**
 * Compute area-weighted normals of each row; +z for rows without faces.
 *
 * @param into - receives three numbers per row and is returned
 * @param rows - the normal row of each corner of the triangles; default: its vertex (no hard edges)
 */
export function computeNormals(
  positions: Float32Array,
  triangles: Uint32Array,
  into: Float32Array,
  rows = triangles,
): Float32Array {
  const sums = new Float64Array(into.length);
  for (let i = 0; i < triangles.length; i += 3) {
    const [a, b, c] = [3 * triangles[i], 3 * triangles[i + 1], 3 * triangles[i + 2]];
    for (let x = 0; x < 3; x++) {
      const [y, z] = [(x + 1) % 3, (x + 2) % 3];
      const normal =
        (positions[b + y] - positions[a + y]) * (positions[c + z] - positions[a + z]) -
        (positions[b + z] - positions[a + z]) * (positions[c + y] - positions[a + y]);
      for (let corner = i; corner < i + 3; corner++) sums[3 * rows[corner] + x] += normal;
    }
  }
  for (let at = 0; at < sums.length; at += 3) {
    const size = Math.hypot(sums[at], sums[at + 1], sums[at + 2]);
    for (let axis = 0; axis < 3; axis++) {
      into[at + axis] = size > 0 ? sums[at + axis] / size : Number(axis === 2);
    }
  }
  return into;
}

/** Gather three numbers per source. */
export function gather(values: Float32Array, sources: Uint32Array, into: Float32Array): void {
  for (let i = 0; i < into.length; i++) {
    into[i] = values[3 * sources[Math.floor(i / 3)] + (i % 3)];
  }
}
