// Modes of a block as small integers, for shaders.

import type { Modes } from "../core/modes.js";
import { CorruptStreamError } from "../errors.js";
import type { TrackFields } from "../types.js";

/** Fields of some frames of a block. */
export type Fields = Omit<TrackFields, "number" | "start">;

/** Of an integer of 16 bits. */
const LARGEST = 32767;

/** How far rounding of the fields moves a vertex at most, in diagonals (a value of a track: in its
 * scale); rounding of the weights to single precision adds less than a tenth of it. */
const ALLOWED_ERROR = 0.9e-5;

/** Rounding steps by which the second field of a mode is finer than the first. */
const FINER = 2 * LARGEST;

/**
 * Round modes to integers of 16 bits, each mode with its own step. A mode whose rounding would be
 * visible has a second field, behind all others: its rounding residual.
 *
 * @param columns - Columns to return.
 * @throws CorruptStreamError if a field is not finite.
 */
export function fieldsOfModes(modes: Modes, columns: readonly number[]): Fields {
  const { nFrames, nItems, nColumns, scale, starts, corrected, corrections } = modes;
  const steps = finestSteps(modes);
  const twice = roughModes(steps, modes);
  const nModes = modes.nModes + twice.length;
  const fields = roundedFields(steps, twice, modes);
  const offsets = columnsOf(corrections, nColumns, columns);
  return {
    ...{ nFrames, nModes, nBlockModes: modes.nModes, nVerts: nItems, nColumns: columns.length },
    origin: columns.map((column) => modes.origin[column]),
    fields,
    means: meansOf(fields, nModes, nItems),
    weights: scaledWeights(steps, twice, modes, columns),
    correctionStarts: starts,
    correctionVertices: corrected,
    correctionOffsets: Float32Array.from(offsets, (offset) => offset * scale),
  };
}

/** Steps, in those of the block, in which the largest value of each mode is the largest integer; 0
 * where all values are. */
function finestSteps({ nModes, values }: Modes): Float64Array {
  const largest = new Float64Array(nModes);
  for (let place = 0; place < values.length; place += nModes) {
    for (let k = 0; k < nModes; k++) {
      const size = Math.abs(values[place + k]);
      if (!(size <= largest[k])) largest[k] = size; // what is no number stays
    }
  }
  if (!largest.every(Number.isFinite)) {
    throw new CorruptStreamError("the fields of a block decode to numbers that are not finite");
  }
  return largest.map((size) => size / LARGEST);
}

/** The modes that need a second field, so that rounding moves no vertex by more than is allowed. */
function roughModes(steps: Float64Array, { nModes, nColumns, nFrames, basis, step }: Modes): number[] {
  const halves = steps.map((one) => (one * step) / 2);
  const found: number[] = [];
  const moves = new Float64Array(nModes);
  for (let t = 0; t < nFrames; t++) {
    let sum = 0;
    for (let k = 0; k < nModes; k++) {
      let square = 0;
      for (let axis = 0; axis < nColumns; axis++) {
        square += basis[(axis * nFrames + t) * nModes + k] ** 2;
      }
      moves[k] = Math.sqrt(square) * halves[k];
      sum += moves[k];
    }
    while (sum > ALLOWED_ERROR && found.length < nModes) {
      let worst = 0;
      for (let k = 1; k < nModes; k++) if (moves[k] > moves[worst]) worst = k;
      if (found.includes(worst)) break; // finer than this it cannot be
      found.push(worst);
      halves[worst] /= FINER;
      sum -= moves[worst];
      moves[worst] /= FINER;
    }
  }
  return found.sort((one, other) => one - other);
}

function roundedFields(
  steps: Float64Array,
  twice: readonly number[],
  { nModes, nItems, rows, values }: Modes,
): Int16Array {
  const fields = new Int16Array((nModes + twice.length) * nItems);
  const factors = steps.map((step) => (step ? 1 / step : 0));
  for (let v = 0; v < nItems; v++) {
    const row = rows[v] * nModes;
    for (let k = 0; k < nModes; k++) {
      fields[k * nItems + v] = Math.round(values[row + k] * factors[k]);
    }
    for (let i = 0; i < twice.length; i++) {
      const left = values[row + twice[i]] * factors[twice[i]] - fields[twice[i] * nItems + v];
      fields[(nModes + i) * nItems + v] = Math.round(left * FINER);
    }
  }
  return fields;
}

function meansOf(fields: Int16Array, nModes: number, nItems: number): Float64Array {
  return Float64Array.from({ length: nModes }, (_, k) => {
    let sum = 0;
    for (let i = k * nItems; i < (k + 1) * nItems; i++) sum += fields[i];
    return sum / nItems;
  });
}

function scaledWeights(
  steps: Float64Array,
  twice: readonly number[],
  { nModes, nFrames, basis, step, scale }: Modes,
  columns: readonly number[],
): Float32Array {
  const modes = [...steps.keys(), ...twice];
  const weights = new Float32Array(columns.length * nFrames * modes.length);
  let place = 0;
  for (let t = 0; t < nFrames; t++) {
    modes.forEach((k, i) => {
      const factor = (steps[k] * step * scale) / (i < nModes ? 1 : FINER);
      for (const column of columns) {
        weights[place++] = factor * basis[(column * nFrames + t) * nModes + k];
      }
    });
  }
  return weights;
}

function columnsOf(rows: Float64Array, width: number, columns: readonly number[]): Float64Array {
  const found = new Float64Array((rows.length / width) * columns.length);
  for (let i = 0, to = 0; i < rows.length; i += width) {
    for (const column of columns) found[to++] = rows[i + column];
  }
  return found;
}

/** The fields at some frames. */
export function partOf(fields: Fields, first: number, nFrames: number): Fields {
  const { nModes, nColumns, weights } = fields;
  const { correctionStarts, correctionVertices, correctionOffsets } = fields;
  const end = first + nFrames;
  const starts = correctionStarts.slice(first, end + 1);
  const [from, to] = [starts[0], starts[nFrames]];
  return {
    ...{ ...fields, nFrames },
    weights: weights.slice(nModes * nColumns * first, nModes * nColumns * end),
    correctionStarts: starts.map((start) => start - from),
    correctionVertices: correctionVertices.slice(from, to),
    correctionOffsets: correctionOffsets.slice(nColumns * from, nColumns * to),
  };
}

/**
 * Fields in which numbers that are missing have NaN for their correction.
 *
 * @param isMissing - Of a frame, an item and one of the columns of `fields`.
 */
export function withMissing(
  fields: Fields,
  isMissing: (frame: number, item: number, column: number) => boolean,
): Fields {
  const { nFrames, nVerts, nColumns, correctionStarts, correctionVertices, correctionOffsets } = fields;
  const starts = new Uint32Array(nFrames + 1);
  const vertices: number[] = [];
  const offsets: number[] = [];
  for (let t = 0; t < nFrames; t++) {
    let next = correctionStarts[t];
    for (let item = 0; item < nVerts; item++) {
      const isCorrected = next < correctionStarts[t + 1] && correctionVertices[next] === item;
      const missing = Array.from({ length: nColumns }, (_, c) => isMissing(t, item, c));
      if (isCorrected || missing.includes(true)) {
        vertices.push(item);
        missing.forEach((isIt, c) => {
          const offset = isCorrected ? correctionOffsets[next * nColumns + c] : 0;
          offsets.push(isIt ? NaN : offset);
        });
      }
      if (isCorrected) next++;
    }
    starts[t + 1] = vertices.length;
  }
  return {
    ...fields,
    correctionStarts: starts,
    correctionVertices: Uint32Array.from(vertices),
    correctionOffsets: Float32Array.from(offsets),
  };
}
