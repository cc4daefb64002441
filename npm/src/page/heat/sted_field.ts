// Local STED: the length-weighted standard deviation of the relative errors of all edges that touch a
// vertex or one of its neighbors, as in meshreel.metrics.edge_neighborhoods.

import { uniqueEdges } from "../edges.js";

/** Sums of weights, weighted values and weighted squares at each vertex. */
type Moments = [Float64Array, Float64Array, Float64Array];

/** Computes local STED. */
export class StedField {
  private readonly edges: Uint32Array;
  /** Pairs of an edge of a 3-cycle and the opposite vertex: the vertex, then the edge. */
  private readonly opposite: Uint32Array;

  constructor(
    faces: Uint32Array,
    private readonly nVerts: number,
  ) {
    this.edges = uniqueEdges(faces, nVerts);
    this.opposite = oppositeEdges(this.edges, nVerts);
  }

  /** Compute values at all vertices from positions (V, 3). */
  values(original: Float32Array, decoded: Float32Array): Float32Array {
    const { edges, opposite } = this;
    const stars = this.moments();
    const nEdges = edges.length / 2;
    const terms: Moments = [0, 1, 2].map(() => new Float64Array(nEdges)) as Moments;
    for (let edge = 0; edge < nEdges; edge++) {
      const [a, b] = [edges[2 * edge], edges[2 * edge + 1]];
      const length = distance(original, a, b);
      const error = length > 0 ? (length - distance(decoded, a, b)) / length : 0;
      terms[0][edge] = length;
      terms[1][edge] = length * error;
      terms[2][edge] = length * error * error;
    }
    // Summing the stars of the neighbors counts edges between two neighbors twice: subtract them once.
    const sums = this.moments();
    terms.forEach((values, k) => {
      values.forEach((value, edge) => {
        stars[k][edges[2 * edge]] += value;
        stars[k][edges[2 * edge + 1]] += value;
      });
      for (let i = 0; i < edges.length; i += 2) {
        sums[k][edges[i]] += stars[k][edges[i + 1]];
        sums[k][edges[i + 1]] += stars[k][edges[i]];
      }
      for (let i = 0; i < opposite.length; i += 2) sums[k][opposite[i]] -= values[opposite[i + 1]];
    });
    return Float32Array.from(sums[0], (total, vertex) => {
      if (!(total > 0)) return 0;
      const mean = sums[1][vertex] / total;
      return Math.sqrt(Math.max(0, sums[2][vertex] / total - mean * mean));
    });
  }

  private moments(): Moments {
    return [0, 1, 2].map(() => new Float64Array(this.nVerts)) as Moments;
  }
}

function distance(positions: Float32Array, a: number, b: number): number {
  const [x, y, z] = [0, 1, 2].map((axis) => positions[3 * b + axis] - positions[3 * a + axis]);
  return Math.hypot(x, y, z);
}

function oppositeEdges(edges: Uint32Array, nVerts: number): Uint32Array {
  const neighbors = Array.from({ length: nVerts }, () => new Set<number>());
  for (let i = 0; i < edges.length; i += 2) {
    neighbors[edges[i]].add(edges[i + 1]);
    neighbors[edges[i + 1]].add(edges[i]);
  }
  const pairs: number[] = [];
  for (let i = 0; i < edges.length; i += 2) {
    const [a, b] = [neighbors[edges[i]], neighbors[edges[i + 1]]];
    const [smaller, larger] = a.size < b.size ? [a, b] : [b, a];
    for (const vertex of smaller) if (larger.has(vertex)) pairs.push(vertex, i / 2);
  }
  return Uint32Array.from(pairs);
}
