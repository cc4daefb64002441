// Values of some frames as small integers, for shaders: of tracks that are not sums of modes.

import { InvalidInputError } from "../errors.js";
import type { TrackValues } from "../types.js";
import type { Fields } from "./of_modes.js";

/** Of an integer of 16 bits. */
const LARGEST = 32767;

/** Columns as small integers at once: each has a mode for each frame. */
const MAX_COLUMNS = 4;

/**
 * Round values to integers of 16 bits: each column at each frame is a mode, and the last mode, 1
 * everywhere, carries the middle of each frame.
 *
 * @param frames - Numbers of each frame, of shape (N, nColumns).
 * @param columns - Columns to return.
 * @param origin - Of each of them, that small integers count from. Default: the middle of its range.
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
      `of an exact track at most ${MAX_COLUMNS} columns are fields at once; got ${width}`,
    );
  }
  const nFrames = frames.length;
  const nVerts = frames[0].length / nColumns;
  const nModes = nFrames * width + 1;
  const fields = new Int16Array(nModes * nVerts).fill(1, (nModes - 1) * nVerts);
  const means = new Float64Array(nModes).fill(1, nModes - 1);
  const weights = new Float32Array(nFrames * nModes * width);
  const numbers = frames.map((values) => columns.map((column) => columnOf(values, nColumns, column)));
  const origins = columns.map(
    (_, c) => origin?.[c] ?? middleOf(numbers.map((ofFrame) => ofFrame[c])) ?? 0,
  );
  const starts = new Uint32Array(nFrames + 1);
  const vertices: number[] = [];
  const offsets: number[] = [];
  for (let t = 0; t < nFrames; t++) {
    const odd = new Map<number, number[]>(); // items with values that are not finite
    for (let c = 0; c < width; c++) {
      const mode = t * width + c;
      const middle = middleOf([numbers[t][c]]) ?? origins[c];
      const away = numbers[t][c].map((value) => value - middle);
      const step = largestOf(away) / LARGEST || 1;
      let sum = 0;
      away.forEach((one, item) => {
        if (Number.isFinite(one)) sum += fields[mode * nVerts + item] = Math.round(one / step);
        else odd.set(item, Object.assign(odd.get(item) ?? columns.map(() => 0), { [c]: one }));
      });
      means[mode] = sum / nVerts;
      weights[(t * nModes + mode) * width + c] = step;
      weights[(t * nModes + nModes - 1) * width + c] = middle - origins[c];
    }
    for (const [item, offset] of [...odd].sort(([one], [other]) => one - other)) {
      vertices.push(item);
      offsets.push(...offset);
    }
    starts[t + 1] = vertices.length;
  }
  return {
    ...{ nFrames, nModes, nBlockModes: nModes, nVerts, nColumns: width },
    ...{ origin: origins, fields, means, weights, correctionStarts: starts },
    correctionVertices: Uint32Array.from(vertices),
    correctionOffsets: Float32Array.from(offsets),
  };
}

function columnOf(values: TrackValues, nColumns: number, column: number): Float64Array {
  const found = new Float64Array(values.length / nColumns);
  for (let i = 0; i < found.length; i++) found[i] = Number(values[i * nColumns + column]);
  return found;
}

/** Between the least and the largest of all finite numbers; null without one. */
function middleOf(rows: readonly Float64Array[]): number | null {
  let [low, high] = [Infinity, -Infinity];
  for (const row of rows) {
    for (const value of row) {
      if (value < low && value > -Infinity) low = value;
      if (value > high && value < Infinity) high = value;
    }
  }
  return low <= high ? low / 2 + high / 2 : null;
}

function largestOf(values: Float64Array): number {
  return values.reduce((most, value) => {
    const size = Math.abs(value);
    return size > most && size < Infinity ? size : most;
  }, 0);
}
