// Errors per vertex of a frame, as in meshreel.metrics.heat. The page computes them itself, so that
// exported pages need no server.

/** Faces of at most this area, in squared diagonals of the frame, have no normal. */
const DEGENERATE_AREA = 1e-14;

/** Kinds of errors of positions; "angle" is that between normals, averaged over the faces of a vertex. */
export type ErrorKind = "distance" | "angle";

/** Compute the errors of all vertices from positions (V, 3); distances in percent of the diagonal. */
export function vertexErrors(
  kind: ErrorKind,
  faces: Uint32Array,
  diagonal: number,
  original: Float32Array,
  decoded: Float32Array,
): Float32Array {
  return kind === "angle" ? angles(faces, original, decoded) : distances(diagonal, original, decoded);
}

function distances(diagonal: number, original: Float32Array, decoded: Float32Array): Float32Array {
  const unit = diagonal > 0 ? 100 / diagonal : 0;
  return new Float32Array(original.length / 3).map((_, vertex) => {
    const at = 3 * vertex;
    const [x, y, z] = [0, 1, 2].map((axis) => decoded[at + axis] - original[at + axis]);
    return unit * Math.hypot(x, y, z);
  });
}

function angles(faces: Uint32Array, original: Float32Array, decoded: Float32Array): Float32Array {
  const minNormal = 2 * DEGENERATE_AREA * diagonalOf(original) ** 2;
  const nVerts = original.length / 3;
  const [sums, counts] = [new Float64Array(nVerts), new Uint32Array(nVerts)];
  for (let i = 0; i < faces.length; i += 3) {
    const face = faces.subarray(i, i + 3);
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
