// Messages between the page and the worker that computes errors.

/** The mesh; sent first. */
export interface MeshMessage {
  triangles: Uint32Array;
  nVerts: number;
  /** Diagonal of the original, in model units. */
  diagonal: number;
}

/** Original and decoded positions (V, 3) of a frame; `kind` is the requested heat map. */
export interface ErrorRequest {
  id: number;
  kind: string;
  original: Float32Array;
  decoded: Float32Array;
}

/** The heat map of a frame. */
export interface ErrorResponse {
  id: number;
  /** Errors of all vertices. */
  values: Float32Array;
}
