// Errors per vertex of a frame, as in meshreel.metrics.heat. The page computes them itself,
// so that exported pages need no server.

import { StedField } from "./sted_field.js";

/** Faces of at most this area, in squared diagonals of the frame, have no normal. */
const DEGENERATE_AREA = 1e-14;

/** Computes errors per vertex. */
export class ErrorFields {
  private sted: StedField | null = null;

  constructor(
    private readonly faces: Uint32Array,
    private readonly nVerts: number,
    private readonly diagonal: number,
  ) {}

  /** Compute a heat map at all vertices from positions (V, 3). */
  values(kind: string, original: Float32Array, decoded: Float32Array): Float32Array {
    if (kind === "distance") return this.distances(original, decoded);
    if (kind === "angle") return this.angles(original, decoded);
    this.sted ??= new StedField(this.faces, this.nVerts);
    return this.sted.values(original, decoded);
  }

  private distances(original: Float32Array, decoded: Float32Array): Float32Array {
    const unit = this.diagonal > 0 ? 100 / this.diagonal : 0;
    return new Float32Array(this.nVerts).map((_, vertex) => {
      const at = 3 * vertex;
      const [x, y, z] = [0, 1, 2].map((axis) => decoded[at + axis] - original[at + axis]);
      return unit * Math.hypot(x, y, z);
    });
  }

  private angles(original: Float32Array, decoded: Float32Array): Float32Array {
    const minNormal = 2 * DEGENERATE_AREA * diagonalOf(original) ** 2;
    const [sums, counts] = [new Float64Array(this.nVerts), new Uint32Array(this.nVerts)];
    for (let i = 0; i < this.faces.length; i += 3) {
      const face = this.faces.subarray(i, i + 3);
      const [a, b] = [normalOf(original, face), normalOf(decoded, face)];
      if (Math.min(Math.hypot(...a), Math.hypot(...b)) <= minNormal) continue;
      const angle = (180 / Math.PI) * Math.atan2(Math.hypot(...cross(a, b)), dot(a, b));
      for (const vertex of face) {
        sums[vertex] += angle;
        counts[vertex]++;
      }
    }
    return Float32Array.from(sums, (sum, vertex) => (counts[vertex] ? sum / counts[vertex] : 0));
  }
}

/** Maximum of the finite values, at least 0. */
export function maxFinite(values: Float32Array): number {
  return values.reduce((maximum, value) => (value > maximum && value < Infinity ? value : maximum), 0);
}

type Vector = [number, number, number];

function normalOf(positions: Float32Array, [a, b, c]: Uint32Array): Vector {
  const along = (to: number) =>
    [0, 1, 2].map((axis) => positions[3 * to + axis] - positions[3 * a + axis]) as Vector;
  return cross(along(b), along(c));
}

function cross([a, b, c]: Vector, [x, y, z]: Vector): Vector {
  return [b * z - c * y, c * x - a * z, a * y - b * x];
}

function dot(a: Vector, b: Vector): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

function diagonalOf(positions: Float32Array): number {
  const [low, high] = [Array(3).fill(Infinity), Array(3).fill(-Infinity)];
  positions.forEach((value, i) => {
    low[i % 3] = Math.min(low[i % 3], value);
    high[i % 3] = Math.max(high[i % 3], value);
  });
  return Math.hypot(...high.map((value, axis) => value - low[axis]));
}
