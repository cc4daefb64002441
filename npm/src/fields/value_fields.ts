// Quantizes frames to 16-bit integers, for shaders: positions and tracks that are stored without
// modes.

import { InvalidInputError } from "../errors.js";
import type { TrackValues } from "../types.js";
import type { Fields } from "./mode_fields.js";

const MAX_INT16 = 32767;

/** Every column takes one mode per frame, which limits the number of columns. */
const MAX_COLUMNS = 4;

/**
 * Round values to 16-bit integers: each column of each frame becomes a mode. The last mode is 1
 * everywhere; its weights are the midranges of the frames.
 *
 * @param frames - Values of each frame, of shape (nItems, nColumns).
 * @param columns - Columns to return.
 * @param origin - Origin of each of these columns. Default: the midrange of its values.
 * @throws InvalidInputError for more than 4 columns.
 */
export function fieldsOfValues(
  frames: readonly TrackValues[],
  nColumns: number,
  columns: readonly number[],
  origin?: readonly number[],
): Fields {
  const width = columns.length;
  if (width > MAX_COLUMNS) {
    throw new InvalidInputError(
      `at most ${MAX_COLUMNS} columns of an exact track can be requested at once; got ${width}`,
    );
  }
  const nFrames = frames.length;
  const nVerts = frames[0].length / nColumns;
  const nModes = nFrames * width + 1;
  const fields = new Int16Array(nModes * nVerts).fill(1, (nModes - 1) * nVerts);
  const means = new Float64Array(nModes).fill(1, nModes - 1);
  const weights = new Float32Array(nFrames * nModes * width);
  const columnValues = frames.map((values) => columns.map((column) => selectColumn(values, nColumns, column)));
  const origins = columns.map(
    (_, c) => origin?.[c] ?? midrange(columnValues.map((ofColumns) => ofColumns[c])) ?? 0,
  );
  const starts = new Uint32Array(nFrames + 1);
  const vertices: number[] = [];
  const offsets: number[] = [];
  for (let t = 0; t < nFrames; t++) {
    const nonFinite = new Map<number, number[]>(); // items with values that are not finite
    for (let c = 0; c < width; c++) {
      const mode = t * width + c;
      const middle = midrange([columnValues[t][c]]) ?? origins[c];
      const centered = columnValues[t][c].map((value) => value - middle);
      const step = maxAbs(centered) / MAX_INT16 || 1;
      let sum = 0;
      centered.forEach((value, item) => {
        if (Number.isFinite(value)) sum += fields[mode * nVerts + item] = Math.round(value / step);
        else nonFinite.set(item, Object.assign(nonFinite.get(item) ?? columns.map(() => 0), { [c]: value }));
      });
      means[mode] = sum / nVerts;
      weights[(t * nModes + mode) * width + c] = step;
      weights[(t * nModes + nModes - 1) * width + c] = middle - origins[c];
    }
    for (const [item, offset] of [...nonFinite].sort(([a], [b]) => a - b)) {
      vertices.push(item);
      offsets.push(...offset);
    }
    starts[t + 1] = vertices.length;
  }
  return {
    ...{ nFrames, nModes, nVerts, nColumns: width },
    ...{ origin: origins, fields, means, weights, correctionStarts: starts },
    correctionVertices: Uint32Array.from(vertices),
    correctionOffsets: Float32Array.from(offsets),
  };
}

function selectColumn(values: TrackValues, nColumns: number, column: number): Float64Array {
  const selected = new Float64Array(values.length / nColumns);
  for (let i = 0; i < selected.length; i++) selected[i] = Number(values[i * nColumns + column]);
  return selected;
}

/** Mean of the minimum and the maximum of all finite values; null if there are none. */
function midrange(rows: readonly Float64Array[]): number | null {
  let [low, high] = [Infinity, -Infinity];
  for (const row of rows) {
    for (const value of row) {
      if (value < low && value > -Infinity) low = value;
      if (value > high && value < Infinity) high = value;
    }
  }
  return low <= high ? low / 2 + high / 2 : null;
}

function maxAbs(values: Float64Array): number {
  return values.reduce((maximum, value) => {
    const magnitude = Math.abs(value);
    return magnitude > maximum && magnitude < Infinity ? magnitude : maximum;
  }, 0);
}
