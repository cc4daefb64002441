// What lies next to each vertex, face or corner, by the core.

import type { Core } from "../core/core.js";
import type { SharedFunctions } from "../core/functions.js";
import type { Scope } from "../core/heap.js";
import type { ItemGraph } from "./connectivity.js";

/** Addresses of arrays: where the neighbours of each item begin, and these, ascending. */
export interface Neighbours {
  readonly starts: number;
  readonly near: number;
  readonly nNear: number;
}

/**
 * The neighbours of each item, in the scope.
 *
 * @param faces - Address of the faces of the graph, in the memory of this core.
 */
export function findNeighbours(
  core: Core<SharedFunctions>,
  scope: Scope,
  faces: number,
  { nVerts, nFaces }: Pick<ItemGraph, "nVerts" | "nFaces">,
): Neighbours {
  const starts = scope.take(4 * (nVerts + 1));
  const near = scope.take(24 * nFaces);
  return core.during((inner) => {
    const [nItems, count] = [BigInt(nVerts), BigInt(nFaces)];
    const size = core.functions.reel_adjacency_memory(nItems, count) >>> 0;
    const memory = inner.take(size);
    const result = core.functions.reel_adjacency(memory, size, faces, count, nItems, starts, near);
    return { starts, near, nNear: core.checked(result, "faces") };
  });
}
