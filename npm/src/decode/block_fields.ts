// A block as small integers, for shaders.

import type { Core } from "../core/core.js";
import type { BlockFields } from "../types.js";
import type { DecodedBlock } from "./decoded_block.js";
import { requireFinite } from "./frames.js";

/** Of an integer of 16 bits. */
const LARGEST = 32767;

/** How far rounding of the fields moves a vertex at most, in diagonals (a value of a track: in its
 * scale); rounding of the weights to single precision adds less than a tenth of it. */
const ALLOWED_ERROR = 0.9e-5;

/** Rounding steps by which the second field of a mode is finer than the first. */
const FINER = 2 * LARGEST;

/**
 * A block as small integers. Each mode uses all of them. Modes whose rounding would show come
 * twice: behind all others there is a field of what rounding has left of them.
 *
 * @param scale - Of positions or of the track.
 * @throws CorruptStreamError where fields are beyond all numbers.
 */
export function fieldsOf(core: Core, scale: number, block: DecodedBlock): BlockFields {
  const { number, start, nFrames, nVerts, corrections } = block;
  const values = core.float64s(block.values.start, nVerts * block.nModes);
  const steps = finestSteps(values, block);
  const twice = roughModes(steps, block);
  const nModes = block.nModes + twice.length;
  const fields = roundedFields(values, steps, twice, block);
  return {
    ...{ number, start, nFrames, nModes, nBlockModes: block.nModes, nVerts },
    fields,
    means: meansOf(fields, nModes, nVerts),
    weights: scaledWeights(steps, twice, block, scale),
    correctionStarts: corrections.starts.slice(),
    correctionVertices: Uint32Array.from(corrections.vertices),
    correctionOffsets: Float32Array.from(corrections.moves, (move) => move * scale),
  };
}

/** Steps, in those of the block, in which the largest value of each mode is the largest integer; 0
 * where all values are. */
function finestSteps(values: Float64Array, block: DecodedBlock): Float64Array {
  const { nModes } = block;
  const largest = new Float64Array(nModes);
  for (let place = 0; place < values.length; place += nModes) {
    for (let k = 0; k < nModes; k++) {
      const size = Math.abs(values[place + k]);
      if (!(size <= largest[k])) largest[k] = size; // what is no number stays
    }
  }
  requireFinite(largest, block);
  return largest.map((size) => size / LARGEST);
}

/** The modes that have to come twice, so that no vertex is moved by more than is allowed. */
function roughModes(steps: Float64Array, block: DecodedBlock): number[] {
  const { nModes, nColumns, nFrames, basis, layout } = block;
  const halves = steps.map((step) => (step * layout.step) / 2);
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
  values: Float64Array,
  steps: Float64Array,
  twice: readonly number[],
  { nModes, nVerts, rows }: DecodedBlock,
): Int16Array {
  const fields = new Int16Array((nModes + twice.length) * nVerts);
  const factors = steps.map((step) => (step ? 1 / step : 0));
  for (let v = 0; v < nVerts; v++) {
    const row = rows[v] * nModes;
    for (let k = 0; k < nModes; k++) {
      fields[k * nVerts + v] = Math.round(values[row + k] * factors[k]);
    }
    for (let i = 0; i < twice.length; i++) {
      const left = values[row + twice[i]] * factors[twice[i]] - fields[twice[i] * nVerts + v];
      fields[(nModes + i) * nVerts + v] = Math.round(left * FINER);
    }
  }
  return fields;
}

function meansOf(fields: Int16Array, nModes: number, nVerts: number): Float64Array {
  return Float64Array.from({ length: nModes }, (_, k) => {
    let sum = 0;
    for (let i = k * nVerts; i < (k + 1) * nVerts; i++) sum += fields[i];
    return sum / nVerts;
  });
}

function scaledWeights(
  steps: Float64Array,
  twice: readonly number[],
  { nModes, nColumns, nFrames, basis, layout }: DecodedBlock,
  scale: number,
): Float32Array {
  const modes = [...steps.keys(), ...twice];
  const weights = new Float32Array(nColumns * nFrames * modes.length);
  let place = 0;
  for (let t = 0; t < nFrames; t++) {
    modes.forEach((k, i) => {
      const step = (steps[k] * layout.step * scale) / (i < nModes ? 1 : FINER);
      for (let axis = 0; axis < nColumns; axis++) {
        weights[place++] = step * basis[(axis * nFrames + t) * nModes + k];
      }
    });
  }
  return weights;
}
