// Quantizes the modes of a block to 16-bit integers, for shaders.

import type { Modes } from "../core/modes.js";
import { CorruptStreamError } from "../errors.js";
import type { TrackFields } from "../types.js";

/** Fields, weights and corrections of some frames of a block. */
export type Fields = Omit<TrackFields, "index" | "start">;

const MAX_INT16 = 32767;

/**
 * Largest displacement of a vertex by rounding of the fields, in diagonals (for values of a track,
 * in units of its scale). Rounding of the weights to float32 adds less than a tenth of it.
 */
const ALLOWED_ERROR = 0.9e-5;

/** Quantization step of the first field of a mode, relative to that of its residual field. */
const RESIDUAL_SCALE = 2 * MAX_INT16;

/**
 * Round modes to 16-bit integers, each mode with its own step. A mode whose rounding would be
 * visible gets a second field with its rounding residual; these follow after all modes.
 *
 * @param columns - Columns to return.
 * @throws CorruptStreamError if a field is not finite.
 */
export function fieldsOfModes(modes: Modes, columns: readonly number[]): Fields {
  const { nFrames, nItems, nColumns, scale, starts, corrected, corrections } = modes;
  const steps = fieldSteps(modes);
  const refined = modesToRefine(steps, modes);
  const nModes = modes.nModes + refined.length;
  const fields = roundFields(steps, refined, modes);
  const offsets = selectColumns(corrections, nColumns, columns);
  return {
    ...{ nFrames, nModes, nVerts: nItems, nColumns: columns.length },
    origin: columns.map((column) => modes.origin[column]),
    fields,
    means: fieldMeans(fields, nModes, nItems),
    weights: scaleWeights(steps, refined, modes, columns),
    correctionStarts: starts,
    correctionVertices: corrected,
    correctionOffsets: Float32Array.from(offsets, (offset) => offset * scale),
  };
}

/**
 * Step of each field, in steps of the block, that maps its largest value to the largest integer; 0
 * if all values are 0.
 */
function fieldSteps({ nModes, values }: Modes): Float64Array {
  const maxima = new Float64Array(nModes);
  for (let row = 0; row < values.length; row += nModes) {
    for (let k = 0; k < nModes; k++) {
      const magnitude = Math.abs(values[row + k]);
      if (!(magnitude <= maxima[k])) maxima[k] = magnitude; // NaN is kept
    }
  }
  if (!maxima.every(Number.isFinite)) {
    throw new CorruptStreamError("a block decodes to fields that are not finite");
  }
  return maxima.map((maximum) => maximum / MAX_INT16);
}

/** Modes that need a residual field to keep the rounding error below `ALLOWED_ERROR`. */
function modesToRefine(steps: Float64Array, { nModes, nColumns, nFrames, basis, step }: Modes): number[] {
  const halfSteps = steps.map((fieldStep) => (fieldStep * step) / 2);
  const selected: number[] = [];
  const errors = new Float64Array(nModes);
  for (let t = 0; t < nFrames; t++) {
    let sum = 0;
    for (let k = 0; k < nModes; k++) {
      let square = 0;
      for (let axis = 0; axis < nColumns; axis++) {
        square += basis[(axis * nFrames + t) * nModes + k] ** 2;
      }
      errors[k] = Math.sqrt(square) * halfSteps[k];
      sum += errors[k];
    }
    while (sum > ALLOWED_ERROR && selected.length < nModes) {
      let worst = 0;
      for (let k = 1; k < nModes; k++) if (errors[k] > errors[worst]) worst = k;
      if (selected.includes(worst)) break; // already as fine as possible
      selected.push(worst);
      halfSteps[worst] /= RESIDUAL_SCALE;
      sum -= errors[worst];
      errors[worst] /= RESIDUAL_SCALE;
    }
  }
  return selected.sort((a, b) => a - b);
}

function roundFields(
  steps: Float64Array,
  refined: readonly number[],
  { nModes, nItems, rows, values }: Modes,
): Int16Array {
  const fields = new Int16Array((nModes + refined.length) * nItems);
  const factors = steps.map((step) => (step ? 1 / step : 0));
  for (let v = 0; v < nItems; v++) {
    const row = rows[v] * nModes;
    for (let k = 0; k < nModes; k++) {
      fields[k * nItems + v] = Math.round(values[row + k] * factors[k]);
    }
    for (let i = 0; i < refined.length; i++) {
      const residual = values[row + refined[i]] * factors[refined[i]] - fields[refined[i] * nItems + v];
      fields[(nModes + i) * nItems + v] = Math.round(residual * RESIDUAL_SCALE);
    }
  }
  return fields;
}

function fieldMeans(fields: Int16Array, nModes: number, nItems: number): Float64Array {
  return Float64Array.from({ length: nModes }, (_, k) => {
    let sum = 0;
    for (let i = k * nItems; i < (k + 1) * nItems; i++) sum += fields[i];
    return sum / nItems;
  });
}

function scaleWeights(
  steps: Float64Array,
  refined: readonly number[],
  { nModes, nFrames, basis, step, scale }: Modes,
  columns: readonly number[],
): Float32Array {
  const modes = [...steps.keys(), ...refined];
  const weights = new Float32Array(columns.length * nFrames * modes.length);
  let to = 0;
  for (let t = 0; t < nFrames; t++) {
    modes.forEach((k, i) => {
      const factor = (steps[k] * step * scale) / (i < nModes ? 1 : RESIDUAL_SCALE);
      for (const column of columns) {
        weights[to++] = factor * basis[(column * nFrames + t) * nModes + k];
      }
    });
  }
  return weights;
}

function selectColumns(rows: Float64Array, width: number, columns: readonly number[]): Float64Array {
  const selected = new Float64Array((rows.length / width) * columns.length);
  for (let i = 0, to = 0; i < rows.length; i += width) {
    for (const column of columns) selected[to++] = rows[i + column];
  }
  return selected;
}

/** Select `nFrames` frames, starting with frame `first` of the block. */
export function sliceFrames(fields: Fields, first: number, nFrames: number): Fields {
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
 * Mark missing values by corrections that are NaN.
 *
 * @param isMissing - Whether the value at a frame, an item and one of the columns is missing.
 */
export function markMissing(
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
        missing.forEach((isValueMissing, c) => {
          const offset = isCorrected ? correctionOffsets[next * nColumns + c] : 0;
          offsets.push(isValueMissing ? NaN : offset);
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
