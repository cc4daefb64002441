// The error of a track at each vertex of a frame, as in meshreel.metrics.track_errors.

import type { Surface, TrackInfo, TrackValues } from "meshreel";

import { type Domain, itemsOf } from "../tracks/items";

/**
 * Errors at every vertex, from values of a frame: the length of the difference, in the unit of the
 * track; of normals the angle in degrees; of colours the largest difference of a number. Of faces
 * and corners it is the largest of those at the vertex. NaN where both values are missing, and
 * where there are none; infinite where one of two is missing.
 */
export function trackErrors(
  { kind, domain, nItems, nColumns }: TrackInfo,
  surface: Surface,
  nVerts: number,
  original: TrackValues,
  decoded: TrackValues,
): Float32Array {
  const errors = new Float32Array(nItems);
  const [given, found] = [new Float64Array(nColumns), new Float64Array(nColumns)];
  for (let item = 0; item < nItems; item++) {
    for (let column = 0; column < nColumns; column++) {
      given[column] = Number(original[item * nColumns + column]);
      found[column] = Number(decoded[item * nColumns + column]);
    }
    errors[item] = errorOf(kind, given, found);
  }
  if (domain === "vertex") return errors;
  const largest = new Float32Array(nVerts).fill(NaN);
  const { triangles } = surface;
  itemsOf(surface, domain as Domain).forEach((item, at) => {
    const vertex = triangles[at];
    const before = largest[vertex];
    if (Number.isNaN(before) || errors[item] > before) largest[vertex] = errors[item];
  });
  return largest;
}

function errorOf(kind: TrackInfo["kind"], given: Float64Array, found: Float64Array): number {
  const isMissing = [given, found].map((value) => value.some(Number.isNaN));
  if (isMissing[0] !== isMissing[1]) return Infinity;
  if (isMissing[0]) return NaN;
  if (kind === "normal") return angleOf(given, found);
  const apart = found.map((value, column) => Math.abs(value - given[column]));
  return kind === "color" ? Math.max(...apart) : Math.hypot(...apart);
}

/** In degrees; 180 where only one of two is 0. */
function angleOf(given: Float64Array, found: Float64Array): number {
  const [a, b] = [Math.hypot(...given), Math.hypot(...found)];
  if (!a || !b) return a === b ? 0 : 180;
  const chord = Math.hypot(...found.map((value, axis) => value / b - given[axis] / a));
  return (360 / Math.PI) * Math.asin(Math.min(1, chord / 2));
}
