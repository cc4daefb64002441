// What the page and the worker that computes errors say to each other.

import type { FrameErrors } from "./fields";

/** Said first: the mesh. */
export interface Meeting {
  triangles: Uint32Array;
  nVerts: number;
  /** Of the original, in model units. */
  diagonal: number;
}

/** Positions (V, 3) of a frame twice; `kind` is the heat map that is wanted, if any. */
export interface Question {
  id: number;
  kind: string | null;
  original: Float32Array;
  decoded: Float32Array;
}

export interface Answer {
  id: number;
  /** Of the heat map at every vertex. */
  values: Float32Array | null;
  errors: FrameErrors;
}
