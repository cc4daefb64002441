// Messages between the page and the worker that computes errors.

import type { FrameErrors } from "./error_fields.js";

/** The mesh; sent first. */
export interface MeshMessage {
  triangles: Uint32Array;
  nVerts: number;
  /** Diagonal of the original, in model units. */
  diagonal: number;
}

/** Original and decoded positions (V, 3) of a frame; `kind` is the requested heat map, if any. */
export interface ErrorRequest {
  id: number;
  kind: string | null;
  original: Float32Array;
  decoded: Float32Array;
}

/** The errors of a frame. */
export interface ErrorResponse {
  id: number;
  /** The heat map at all vertices. */
  values: Float32Array | null;
  errors: FrameErrors;
}
