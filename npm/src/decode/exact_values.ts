// Values that are stored bit for bit, by a module of the core of their own; docs/format.md, "Exact
// values".

import type { Core } from "../core/core.js";
import type { ExactFunctions } from "../core/functions.js";
import { MeshReelError } from "../errors.js";
import type { TrackValues } from "../types.js";
import type { ItemGraph } from "./connectivity.js";
import { findNeighbours } from "./neighbours.js";
import type { NumberType } from "./number_types.js";

/** The core for exact values. */
export type ExactCore = Core<ExactFunctions>;

/** What the core works with: bytes for each number, beside itself; for each item; for each frame. */
const BYTES_OF_WORK = [11, 64, 512] as const;

/** Memory that a page can have. */
const MOST_BYTES = 2 ** 32;

/** Decodes blocks of exact values on a graph, in any order. */
export class ExactDecoder {
  private readonly starts: number;
  private readonly near: number;

  /**
   * @param memory - Of the core that the faces of the graph lie in.
   * @param graph - What values lie on.
   */
  constructor(
    private readonly core: ExactCore,
    memory: Core,
    private readonly graph: ItemGraph,
  ) {
    const faces = memory.bytes(graph.internalFaces, 12 * graph.nFaces);
    [this.starts, this.near] = core.keeping((scope, keep) => {
      const given = scope.put(faces);
      const { starts, near, nNear } = findNeighbours(core, scope, given, graph);
      core.heap.shrink(near, 4 * nNear);
      return [keep(starts), keep(near)];
    });
  }

  /**
   * The numbers of a block, of shape (T, N, C), items as they go out.
   *
   * @throws CorruptStreamError where the bytes are not those of such a block.
   * @throws MeshReelError where it is too large for a page.
   */
  decode(data: Uint8Array, nFrames: number, nColumns: number, numbers: NumberType): TrackValues {
    const { core, graph } = this;
    const { nVerts, sequence } = graph;
    const count = nFrames * nVerts * nColumns;
    const [ofNumber, ofItem, ofFrame] = BYTES_OF_WORK;
    const needed =
      (ofNumber + 2 * numbers.sizeBytes) * count + ofItem * nVerts + ofFrame * nFrames;
    if (needed + data.length > MOST_BYTES) {
      throw new MeshReelError(
        `a block of ${count} exact values is too large for a page: it needs ` +
          `${Math.ceil(needed / 1e6)} MB; encode with fewer frames in a block`,
      );
    }
    return core.during((scope) => {
      const shape = [BigInt(nFrames), BigInt(nVerts), BigInt(nColumns)] as const;
      const size = core.functions.reel_exact_memory(...shape) >>> 0;
      const values = scope.take(numbers.sizeBytes * count);
      const result = core.functions.reel_exact_decode(
        scope.take(size),
        size,
        scope.put(data),
        data.length,
        values,
        ...shape,
        BigInt(numbers.sizeBytes),
        BigInt(numbers.type),
        this.starts,
        this.near,
      );
      core.checked(result, "values");
      const row = numbers.sizeBytes * nColumns;
      const found = new Uint8Array(row * nVerts * nFrames);
      const coded = core.bytes(values, found.length);
      for (let t = 0, to = 0; t < nFrames; t++) {
        for (let i = 0; i < nVerts; i++, to += row) {
          const from = row * (t * nVerts + sequence[i]);
          for (let k = 0; k < row; k++) found[to + k] = coded[from + k];
        }
      }
      return numbers.view(found.buffer, 0, count);
    });
  }
}
