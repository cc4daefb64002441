// Errors of a track per vertex of a frame, as in meshreel.metrics.track_errors.

import type { Surface, TrackInfo, TrackValues } from "../../index.js";

import { createItemLookup } from "../../three/corners.js";
import { KIND_ROWS } from "../../track_kinds.js";

/**
 * Compute the errors of a track at all vertices: the length of the difference, in the unit of the
 * track; for normals the angle in degrees; for colors the largest difference of a number. Tracks of
 * faces and corners yield the maximum at each vertex. NaN if both values are missing or there are
 * none; infinity if only one is missing.
 */
export function trackErrors(
  { kind, domain, nItems, nColumns }: TrackInfo,
  surface: Surface,
  nVerts: number,
  original: TrackValues,
  decoded: TrackValues,
): Float32Array {
  const errors = new Float32Array(nItems);
  const [originalValue, decodedValue] = [new Float64Array(nColumns), new Float64Array(nColumns)];
  for (let item = 0; item < nItems; item++) {
    for (let column = 0; column < nColumns; column++) {
      originalValue[column] = Number(original[item * nColumns + column]);
      decodedValue[column] = Number(decoded[item * nColumns + column]);
    }
    errors[item] = valueError(KIND_ROWS[kind]?.error, originalValue, decodedValue);
  }
  if (domain === "vertex") return errors;
  const maxima = new Float32Array(nVerts).fill(NaN);
  const itemAt = createItemLookup(surface)(domain);
  surface.triangles.forEach((vertex, corner) => {
    const error = errors[itemAt(corner)];
    if (Number.isNaN(maxima[vertex]) || error > maxima[vertex]) maxima[vertex] = error;
  });
  return maxima;
}

function valueError(measure: string | undefined, originalValue: Float64Array, decodedValue: Float64Array): number {
  const isMissing = [originalValue, decodedValue].map((value) => value.some(Number.isNaN));
  if (isMissing[0] !== isMissing[1]) return Infinity;
  if (isMissing[0]) return NaN;
  if (measure === "angle") return angleDeg(originalValue, decodedValue);
  const differences = decodedValue.map((value, column) => Math.abs(value - originalValue[column]));
  return measure === "number" ? Math.max(...differences) : Math.hypot(...differences);
}

/** Angle in degrees; 180 if only one of the vectors is 0. */
function angleDeg(originalValue: Float64Array, decodedValue: Float64Array): number {
  const [a, b] = [Math.hypot(...originalValue), Math.hypot(...decodedValue)];
  if (!a || !b) return a === b ? 0 : 180;
  const chord = Math.hypot(...decodedValue.map((value, axis) => value / b - originalValue[axis] / a));
  return (360 / Math.PI) * Math.asin(Math.min(1, chord / 2));
}
