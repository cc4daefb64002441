// A block of frames on the GPU: mode fields as they are stored, four to a texel, and the weights
// and corrections of each frame, which the processor hands over as they are needed.

import * as THREE from "three";

import { loadPacket } from "../data";
import type { VertexGrid } from "./grid";

export interface FrameWeights {
  /** For each four modes: their weights for x, then y, then z. */
  weights: Float32Array;
  nGroups: number;
}

export interface Corrections {
  vertices: Uint32Array;
  offsets: Float32Array;
}

export class ModeBlock {
  private constructor(
    readonly nFrames: number,
    readonly nModes: number,
    readonly fields: THREE.DataArrayTexture,
    private readonly means: Float64Array,
    private readonly weights: Float32Array,
    private readonly rest: Float64Array,
    private readonly correctionStarts: Uint32Array,
    private readonly correctionVertices: Uint32Array,
    private readonly correctionValues: Float32Array,
  ) {}

  static async load(number: number, grid: VertexGrid): Promise<ModeBlock> {
    const packet = await loadPacket(`api/block/${number}`);
    const nModes = packet.fields.n_modes as number;
    const nFrames = packet.fields.n_frames as number;
    const fields = packet.array("fields", "int16", [nModes, grid.nVerts]);
    const steps = packet.array("field_scales", "float32", [nModes]);
    const weights = packet
      .array("weights", "float32", [nFrames, nModes, 3])
      .map((weight, i) => weight * steps[Math.floor(i / 3) % nModes]);
    return new ModeBlock(
      nFrames,
      nModes,
      fieldTexture(fields, nModes, grid),
      meansOf(fields, nModes),
      weights,
      meanOf(weights, nFrames),
      packet.array("correction_starts", "uint32", [nFrames + 1]),
      packet.array("correction_vertices", "uint32", [null]),
      packet.array("correction_values", "float32", [null, 3]),
    );
  }

  /**
   * Weights between frame `t`, counted in the block, and the next. Only the first modes move; the
   * others rest at their mean over the block, so that few modes begin with its mean shape.
   */
  weightsAt(t: number, fraction: number, nModes: number): FrameWeights {
    const nGroups = Math.ceil(this.nModes / 4);
    const grouped = new Float32Array(nGroups * 12);
    const here = t * this.nModes * 3;
    const next = fraction > 0 ? here + this.nModes * 3 : here;
    for (let mode = 0; mode < this.nModes; mode++) {
      for (let axis = 0; axis < 3; axis++) {
        const at = mode * 3 + axis;
        const weight =
          mode < nModes
            ? (1 - fraction) * this.weights[here + at] + fraction * this.weights[next + at]
            : this.rest[at];
        grouped[(mode >> 2) * 12 + axis * 4 + (mode & 3)] = weight;
      }
    }
    return { weights: grouped, nGroups };
  }

  /** The mean of all vertices between frame `t` and the next, as the first modes move them. */
  centreAt(t: number, fraction: number, nModes: number): THREE.Vector3 {
    const centre = new THREE.Vector3();
    const { weights } = this.weightsAt(t, fraction, nModes);
    this.means.forEach((mean, mode) => {
      const at = (mode >> 2) * 12 + (mode & 3);
      centre.x += mean * weights[at];
      centre.y += mean * weights[at + 4];
      centre.z += mean * weights[at + 8];
    });
    return centre;
  }

  /** Corrections between frame `t` and the next; each vertex comes once. */
  correctionsAt(t: number, fraction: number): Corrections {
    if (fraction === 0) {
      const [start, end] = [this.correctionStarts[t], this.correctionStarts[t + 1]];
      return {
        vertices: this.correctionVertices.subarray(start, end),
        offsets: this.correctionValues.subarray(3 * start, 3 * end),
      };
    }
    return blend(this.correctionsAt(t, 0), 1 - fraction, this.correctionsAt(t + 1, 0), fraction);
  }

  /** The most corrections that two frames in a row have together. */
  get mostCorrections(): number {
    const starts = this.correctionStarts;
    let most = 0;
    for (let t = 0; t < this.nFrames; t++) {
      most = Math.max(most, starts[Math.min(t + 2, this.nFrames)] - starts[t]);
    }
    return most;
  }

  dispose(): void {
    this.fields.dispose();
  }
}

function fieldTexture(
  fields: Int16Array,
  nModes: number,
  grid: VertexGrid,
): THREE.DataArrayTexture {
  const { nVerts, nTexels } = grid;
  const nGroups = Math.ceil(nModes / 4);
  const packed = new Int16Array(nGroups * nTexels * 4);
  for (let mode = 0; mode < nModes; mode++) {
    let to = (mode >> 2) * nTexels * 4 + (mode & 3);
    for (let from = mode * nVerts; from < (mode + 1) * nVerts; from++, to += 4) {
      packed[to] = fields[from];
    }
  }
  const texture = new THREE.DataArrayTexture(packed, grid.width, grid.height, Math.max(1, nGroups));
  texture.format = THREE.RGBAIntegerFormat;
  texture.type = THREE.ShortType;
  texture.internalFormat = "RGBA16I";
  texture.needsUpdate = true;
  return texture;
}

/** The mean over the frames of the weights (T, K, 3), of shape (K, 3). */
function meanOf(weights: Float32Array, nFrames: number): Float64Array {
  const mean = new Float64Array(weights.length / Math.max(1, nFrames));
  weights.forEach((weight, i) => (mean[i % mean.length] += weight / nFrames));
  return mean;
}

function meansOf(fields: Int16Array, nModes: number): Float64Array {
  const nVerts = fields.length / Math.max(1, nModes);
  return Float64Array.from({ length: nModes }, (_, mode) => {
    const field = fields.subarray(mode * nVerts, (mode + 1) * nVerts);
    return field.reduce((sum, value) => sum + value, 0) / nVerts;
  });
}

function blend(first: Corrections, a: number, second: Corrections, b: number): Corrections {
  const sums = new Map<number, [number, number, number]>();
  for (const [{ vertices, offsets }, share] of [
    [first, a],
    [second, b],
  ] as const) {
    vertices.forEach((vertex, i) => {
      const sum = sums.get(vertex) ?? [0, 0, 0];
      sums.set(
        vertex,
        sum.map((value, axis) => value + share * offsets[3 * i + axis]) as typeof sum,
      );
    });
  }
  return {
    vertices: Uint32Array.from(sums.keys()),
    offsets: Float32Array.from([...sums.values()].flat()),
  };
}
