// All vertices of a mesh from coarse to fine, and what predicts each, by the core.

import type { Core } from "../core/core.js";
import { int64s } from "../core/int64.js";
import { type ItemGraph, inverse } from "./connectivity.js";
import type { CodingOrder } from "./fields.js";
import { findNeighbours } from "./neighbours.js";

/** As in core/reel.h. */
const MAX_LEVELS = 61;
const SMOOTH_ROWS = 4;
const SMOOTH_ROW_BYTES = 64;
const NEIGHBOURS = 8;
const MESH_BYTES = 48;

/** What follows from connectivity and the size of stencils; addresses of arrays. */
export interface Hierarchy {
  readonly stencilSize: number;
  /** The `reel_mesh` of core/reel.h. */
  readonly mesh: number;
  /** The place of each vertex that goes out in the order of coding; no address. */
  readonly rows: Int32Array;
  readonly codingOrder: CodingOrder;
  /** All memory that it takes. */
  readonly parts: readonly number[];
}

/** The hierarchy of a mesh, or of its faces or corners; whoever asks gives its parts back. */
export function buildHierarchy(
  core: Core,
  items: ItemGraph,
  stencilSize: number,
): Hierarchy {
  const { nVerts, sequence } = items;
  return core.keeping((scope, keep) => {
    const parts: number[] = [];
    const take = (sizeBytes: number): number => {
      parts.push(keep(scope.take(sizeBytes)));
      return parts[parts.length - 1];
    };
    const mesh = take(MESH_BYTES);
    const columns = take(4 * nVerts);
    const nearStarts = take(8 * (nVerts + 1));
    const levels = {
      starts: take(4 * (MAX_LEVELS + 1)),
      resolutions: take(4 * MAX_LEVELS),
      smoothStarts: take(8 * MAX_LEVELS),
    };
    const stencil = take(4 * nVerts * stencilSize);
    const hops = take(nVerts * stencilSize);
    const near = take(4 * NEIGHBOURS * nVerts);
    const smooth = take(SMOOTH_ROWS * SMOOTH_ROW_BYTES * nVerts);

    const { nLevels, rows } = core.during((inner) => {
      const graph = findNeighbours(core, inner, items.internalFaces, items);
      const order = inner.take(4 * nVerts);
      const verts = BigInt(nVerts);
      const size = core.functions.reel_hierarchy_memory(verts, BigInt(graph.nNear)) >>> 0;
      const result = core.functions.reel_hierarchy(
        inner.take(size),
        size,
        graph.starts,
        graph.near,
        verts,
        BigInt(stencilSize),
        order,
        levels.starts,
        levels.resolutions,
        levels.smoothStarts,
        stencil,
        hops,
        near,
        smooth,
      );
      const nLevels = core.checked(result, "stencils");
      const places = inverse(core.int32s(order, nVerts));
      return { nLevels, rows: sequence.map((vertex) => places[vertex]) };
    });

    const inOrder = core.int32s(columns, nVerts);
    for (let i = 0; i < nVerts; i++) inOrder[i] = i;
    const starts = core.int32s(levels.starts, nLevels + 1);
    const resolutions = core.int32s(levels.resolutions, nLevels);
    const isMany = resolutions[nLevels - 1] > 0;
    const finest = core.int32s(levels.smoothStarts, 2 * nLevels)[2 * nLevels - 2];
    core.heap.shrink(smooth, isMany ? SMOOTH_ROW_BYTES * (finest + nVerts) : 0);
    const pointers = [levels.starts, levels.smoothStarts, stencil, hops, smooth, 0];
    core.uint32s(mesh, 12).set([nVerts, 0, nLevels, 0, stencilSize, 0, ...pointers]);

    const ends = [...starts.subarray(1)].filter((_, i) => resolutions[i] !== resolutions[i + 1]);
    const nNear = joinRows(
      core.int32s(near, NEIGHBOURS * nVerts),
      core.uint32s(nearStarts, 2 * nVerts + 2),
    );
    core.heap.shrink(near, 4 * nNear);
    const passStarts = take(8 * (ends.length + 1));
    core.uint32s(passStarts, 2 * ends.length + 2).set(int64s([0, ...ends]));
    const passes = { nPasses: ends.length, passStarts };
    const codingOrder = { nColumns: nVerts, columns, ...passes, nearStarts, nNear, near };
    return { stencilSize, mesh, rows, codingOrder, parts };
  });
}

/**
 * Moves the rows of context neighbours, filled up with -1, to one another.
 *
 * @param starts - Where each row then begins, as integers of 64 bits.
 * @returns How many neighbours there are.
 */
function joinRows(near: Int32Array, starts: Uint32Array): number {
  let count = 0;
  starts.fill(0);
  for (let i = 0; i < near.length;) {
    for (const end = i + NEIGHBOURS; i < end; i++) if (near[i] >= 0) near[count++] = near[i];
    starts[(2 * i) / NEIGHBOURS] = count;
  }
  return count;
}
