// Tracks that are coded as what the positions leave of them: velocities and normals; docs/format.md,
// "Tracks".

import type { TrackValues } from "../types.js";
import type { Polygons } from "../surface/polygons.js";
import type { Positions } from "./frames.js";
import { integersOf } from "./number_types.js";
import type { Track } from "./track.js";
import { EXACT_BACKWARD } from "./track_infos.js";

/** Codings of such tracks. */
export const TURNS = 2;
export const BACKWARD = 3;
const CENTRAL = 4;
const FORWARD = 5;

/** Numbers that turn a normal. */
export const TURN_COLUMNS = 2;

/** What tracks on a mesh are predicted with. */
export interface MovingSurface {
  /** Triangles of CONNECTIVITY, in its order, by vertices as they go out. */
  readonly connected: Uint32Array;
  readonly polygons: Polygons;
  /** The vertex of each row, where values of corners are those of rows. */
  readonly vertexOfRow: Int32Array | null;
}

/**
 * Values of a block, of shape (T, N, 3).
 *
 * @param coded - What is decoded at a frame of the block, not rounded.
 * @param positions - Of the frames of the block, as they go out.
 */
export function predictedValues(
  track: Track,
  coded: (time: number) => Positions,
  positions: readonly Positions[],
  surface: MovingSurface,
): TrackValues {
  const { coding, rate, domain, numbers } = track;
  const nItems = surface.vertexOfRow?.length ?? surface.polygons.count(domain);
  const length = positions.length * nItems * 3;
  const buffer = new ArrayBuffer(length * numbers.sizeBytes);
  const values = numbers.view(buffer, 0, length) as Positions;
  positions.forEach((here, t) => {
    const found = coded(t);
    const out = values.subarray(3 * nItems * t, 3 * nItems * (t + 1));
    if (coding === TURNS) turn(normalsOf(domain, here, surface), found, out);
    else {
      const difference = differences(coding, positions, t);
      for (let i = 0; i < out.length; i++) out[i] = rate * difference(i) + found[i];
    }
  });
  return values;
}

/**
 * Values of a block that are exact, of shape (T, N, 3).
 *
 * @param moves - How many places each is behind what positions let expect, as signed integers.
 * @param positions - Of the frames of the block, as they go out.
 */
export function exactlyPredicted(
  { coding, rate, numbers }: Track,
  moves: TrackValues,
  positions: readonly Positions[],
): TrackValues {
  const buffer = new ArrayBuffer(moves.byteLength);
  const values = numbers.view(buffer, 0, moves.length) as Positions;
  const kind = coding - EXACT_BACKWARD + BACKWARD;
  const [{ length }] = positions;
  positions.forEach((_, t) => {
    const difference = differences(kind, positions, t);
    for (let i = 0; i < length; i++) {
      const at = t * length + i;
      values[at] = rate * difference(i);
      if (!Number.isFinite(values[at])) values[at] = 0;
    }
  });
  const bits = integersOf(numbers).view(buffer, 0, moves.length);
  if (bits instanceof BigInt64Array) {
    const place = (one: bigint): bigint => (one < 0n ? one ^ 0x7fffffffffffffffn : one);
    const by = moves as BigInt64Array;
    bits.forEach((one, i) => (bits[i] = place(BigInt.asIntN(64, place(one) + by[i]))));
  } else {
    const place = (one: number): number => (one < 0 ? one ^ 0x7fffffff : one);
    const by = moves as Int32Array;
    (bits as Int32Array).forEach((one, i) => (bits[i] = place((place(one) + by[i]) | 0)));
  }
  return values;
}

/** What a frame of a block is apart from those beside it: a number of each coordinate. */
function differences(
  coding: number,
  positions: readonly Positions[],
  t: number,
): (coordinate: number) => number {
  const last = positions.length - 1;
  const isInside = t > 0 && t < last;
  const first = t === 0 || (isInside && coding === FORWARD) ? t : t - 1;
  const second = t === last || (isInside && coding === BACKWARD) ? t : t + 1;
  const by = isInside && coding === CENTRAL ? 2 : 1;
  const [a, b] = [positions[first], positions[second]];
  return (i) => (b[i] - a[i]) / by;
}

/** Normals of the surface, of length 1 or 0. */
function normalsOf(
  domain: Track["domain"],
  positions: Positions,
  { connected, polygons, vertexOfRow }: MovingSurface,
): Float64Array {
  if (domain === "face") {
    const faces = polygons.facesOfTriangles();
    const of = (corner: number): number => faces[corner];
    return sums(positions, polygons.triangles, of, 1, polygons.count("face"));
  }
  const ofVertices = sums(positions, connected, (corner) => connected[corner], 3, polygons.nVerts);
  if (domain === "vertex") return ofVertices;
  if (vertexOfRow) {
    const found = new Float64Array(3 * vertexOfRow.length);
    vertexOfRow.forEach((vertex, row) =>
      found.set(ofVertices.subarray(3 * vertex, 3 * vertex + 3), 3 * row),
    );
    return found;
  }
  const found = new Float64Array(3 * polygons.count("corner"));
  polygons.cornersOfTriangles().forEach((corner, i) => {
    const vertex = 3 * polygons.triangles[i];
    found.set(ofVertices.subarray(vertex, vertex + 3), 3 * corner);
  });
  return found;
}

/**
 * Sums of cross products of the sides of triangles, divided by their length.
 *
 * @param itemOf - What a corner of a triangle belongs to.
 * @param nCorners - Of each triangle that count.
 */
function sums(
  positions: Positions,
  triangles: Uint32Array,
  itemOf: (corner: number) => number,
  nCorners: 1 | 3,
  nItems: number,
): Float64Array {
  const found = new Float64Array(3 * nItems);
  const [u, w] = [new Float64Array(3), new Float64Array(3)];
  for (let i = 0; i < triangles.length; i += 3) {
    const [a, b, c] = [3 * triangles[i], 3 * triangles[i + 1], 3 * triangles[i + 2]];
    for (let axis = 0; axis < 3; axis++) {
      u[axis] = positions[b + axis] - positions[a + axis];
      w[axis] = positions[c + axis] - positions[a + axis];
    }
    for (let corner = i; corner < i + nCorners; corner++) {
      const to = 3 * itemOf(corner);
      found[to] += u[1] * w[2] - u[2] * w[1];
      found[to + 1] += u[2] * w[0] - u[0] * w[2];
      found[to + 2] += u[0] * w[1] - u[1] * w[0];
    }
  }
  for (let at = 0; at < found.length; at += 3) {
    const [x, y, z] = [found[at], found[at + 1], found[at + 2]];
    const length = Math.sqrt(x * x + y * y + z * z);
    const isThere = length > 0 && length < Infinity;
    for (let axis = 0; axis < 3; axis++) found[at + axis] = isThere ? found[at + axis] / length : 0;
  }
  return found;
}

/** Normals, turned by two numbers each. */
function turn(normals: Float64Array, turns: Positions, out: Positions): void {
  for (let at = 0, from = 0; at < out.length; at += 3, from += TURN_COLUMNS) {
    const [x, y, z] = [normals[at], normals[at + 1], normals[at + 2]];
    const [a, b] = [turns[from], turns[from + 1]];
    const k = (a * a + b * b) / 4;
    if (!(x || y || z) || !Number.isFinite(k)) continue; // 0
    const side = 1 + z < 2 ** -20 ? -1 : 1;
    const d = 1 + side * z;
    const across = -((x * y) / d);
    out[at] = ((1 - k) * x + (a * (1 - (x * x) / d) + b * across)) / (1 + k);
    out[at + 1] = ((1 - k) * y + (a * across + b * (1 - (y * y) / d))) / (1 + k);
    out[at + 2] = ((1 - k) * z + (a * -(side * x) + b * -(side * y))) / (1 + k);
  }
}
