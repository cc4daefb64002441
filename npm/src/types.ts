// What the parts of the package agree on.

/** Where bytes come from: an address, a response, a blob or memory. */
export interface ByteSource {
  /** Bytes in all; null as long as the source does not say. */
  readonly size: number | null;
  /** Whether parts can be had without what lies before them. */
  readonly hasRanges: boolean;
  /**
   * A copy of the bytes `start` to `end - 1`, fewer where the source ends before.
   *
   * @throws SourceError where they cannot be had, or are of another file than before.
   */
  read(start: number, end: number, signal?: AbortSignal): Promise<Uint8Array>;
  close(): void;
}

/** Positions, x, y and z of each vertex, in the number type of the file. */
export type Positions = Float32Array | Float64Array;

/** Facts of a stream. */
export interface ReelInfo {
  /** Positions are sums of modes; exact; or exact places of a grid. */
  readonly method: "reel" | "lossless" | "grid";
  readonly name: string;
  readonly nFrames: number;
  readonly nVerts: number;
  /** Triangles. */
  readonly nFaces: number;
  /** Frames per second; 0 where the file does not say. */
  readonly fps: number;
  /** Time of the first frame in seconds. */
  readonly startS: number;
  /** Of the bounding box of all frames, in model units. */
  readonly center: readonly [number, number, number];
  readonly diagonal: number;
  /** Largest displacement of any vertex that the encoder promises, in percent of the diagonal. */
  readonly promisePercent: number | null;
  readonly numberType: "float32" | "float64";
  /** Quantities that change over time beside the positions; `ReelFile.track` gives their values. */
  readonly tracks: readonly TrackInfo[];
  /** Frames that `fields` gives at once. */
  readonly blocks: readonly BlockInfo[];
}

/** A track: a quantity of vertices, faces or corners that changes over time. */
export interface TrackInfo {
  readonly name: string;
  /** Such as "Pa"; empty where the file does not say. */
  readonly unit: string;
  readonly kind:
    | "scalar"
    | "vector"
    | "velocity"
    | "normal"
    | "color"
    | "uv"
    | "other";
  /** What values are of; faces are polygons, and corners are theirs. */
  readonly domain: "vertex" | "face" | "corner";
  /** Numbers of a value. */
  readonly nColumns: number;
  /** Vertices, faces or corners that have a value at each frame. */
  readonly nItems: number;
  readonly numberType:
    | "float32"
    | "float64"
    /** Of tracks that are coded exactly. */
    | `${"u" | ""}int${8 | 16 | 32 | 64}`;
  /** Whether numbers are those of the original, bit for bit. */
  readonly isExact: boolean;
  /**
   * Largest error of a value that the encoder promises: the length of the difference, in the unit of
   * the track; of normals the angle in degrees; of colours that of each number. Null: none.
   */
  readonly promisedError: number | null;
  /** In all blocks. */
  readonly sizeBytes: number;
}

/**
 * Numbers of a track, in the array of their type; integers of 64 bits are bigints. A number that is
 * missing is NaN.
 */
export type TrackValues =
  | Float32Array
  | Float64Array
  | Int8Array
  | Int16Array
  | Int32Array
  | Uint8Array
  | Uint16Array
  | Uint32Array
  | BigInt64Array
  | BigUint64Array;

/**
 * A block of the file; where the method is not "reel", whose blocks may have thousands of frames, a
 * part of one, of up to 32.
 */
export interface BlockInfo {
  /** Number of its first frame. */
  readonly start: number;
  readonly nFrames: number;
  /** Of a part its share of the block. */
  readonly sizeBytes: number;
}

/**
 * A block of frames as small integers, for shaders: the position of vertex v at frame t of the
 * block, relative to `ReelInfo.center`, is, in each axis, the sum over modes k of
 * `fields[k nVerts + v] * weights[(t nModes + k) 3 + axis]`, plus its correction. In model units,
 * within 1e-5 of the diagonal of what `frame` gives. Where the method is not "reel", each axis at
 * each frame is a mode, and the last mode is 1 everywhere.
 */
export interface BlockFields {
  readonly number: number;
  readonly start: number;
  readonly nFrames: number;
  readonly nModes: number;
  /** Modes of the block: those behind them are finer parts of some of these. */
  readonly nBlockModes: number;
  readonly nVerts: number;
  /** nModes x nVerts, vertices as they go out. The first modes are the coarser animation. */
  readonly fields: Int16Array;
  /** Of each field, over all vertices. */
  readonly means: Float64Array;
  /** nFrames x nModes x 3. Steps of the fields are multiplied in. */
  readonly weights: Float32Array;
  /** Corrections of frame t are correctionStarts[t] .. correctionStarts[t + 1] - 1. */
  readonly correctionStarts: Uint32Array;
  readonly correctionVertices: Uint32Array;
  /** Three for each, in model units. */
  readonly correctionOffsets: Float32Array;
}

/**
 * A track in a block as small integers, for shaders: the number in column c of item i at frame t of
 * the block is the sum over modes k of `fields[k nItems + i] * weights[(t nModes + k) nColumns + c]`,
 * plus `origin[c]`, plus its correction; normals are not yet divided by their length. Where a number
 * is missing, that correction is NaN. Of a track that is exact, or predicted from positions, each
 * column at each frame is a mode, rounded to a part in 65534 of its range there, and the last mode
 * is 1 everywhere. The rest is as in `BlockFields`, where items are vertices.
 */
export interface TrackFields extends BlockFields {
  /** Columns that were asked for: c counts these. */
  readonly nColumns: number;
  /** Of each column. */
  readonly origin: readonly number[];
}

/** A quantity that faces, corners or vertices have: texture coordinates, a colour. */
export interface Attribute {
  readonly name: string;
  readonly kind: "uv" | "color" | "other";
  readonly domain: "vertex" | "face" | "corner";
  readonly width: number;
  /** Rows of `width` numbers, one for each vertex, face or corner. */
  readonly values: Uint8Array | Int32Array | Float32Array | Float64Array;
}

export interface Image {
  readonly name: string;
  /** Such as "image/png". */
  readonly mediaType: string;
  readonly bytes: Uint8Array;
}

/** How a slot of a material looks up an image. */
export interface MaterialTexture {
  readonly slot: "baseColor" | "metallic" | "roughness" | "normal" | "occlusion" | "emissive";
  /** Number among `Surface.images`. */
  readonly image: number;
  /** Name of the attribute that holds its texture coordinates. */
  readonly uv: string;
  readonly offset: readonly [number, number];
  readonly rotation: number;
  readonly scale: readonly [number, number];
  /** docs/format.md: 0 repeat, 1 mirror, 2 clamp, 3 black, 4 as the image says. */
  readonly wrapU: number;
  readonly wrapV: number;
}

/** Terms of materials in glTF 2.0. */
export interface Material {
  readonly name: string;
  readonly alphaMode: "opaque" | "mask" | "blend";
  readonly doubleSided: boolean;
  readonly unlit: boolean;
  readonly baseColor: readonly [number, number, number, number];
  readonly metallic: number;
  readonly roughness: number;
  readonly emissive: readonly [number, number, number];
  readonly normalScale: number;
  readonly occlusionStrength: number;
  readonly alphaCutoff: number;
  readonly textures: readonly MaterialTexture[];
}

/** What the mesh is beside its positions; the same at all frames. */
export interface Surface {
  /** Triangles: 3 nFaces numbers of vertices. */
  readonly triangles: Uint32Array;
  /** Corners of each polygon, or null where all faces are triangles. */
  readonly faceSizes: Uint32Array | null;
  readonly attributes: readonly Attribute[];
  /** Groups of faces, such as "material": labels, and that of each face, -1 for none. */
  readonly groups: readonly { name: string; labels: readonly string[]; ofFace: Int32Array }[];
  readonly materials: readonly Material[];
  readonly images: readonly Image[];
  /**
   * Edges across which faces do not share normals: pairs of vertices, the lower first; null where
   * the mesh is smooth.
   */
  readonly hardEdges: Uint32Array | null;
}

/** A track of an open file. */
export interface OpenTrack {
  readonly info: TrackInfo;
  /**
   * Values of a frame: nItems x nColumns, of the type of the track, into `into` where it is given.
   */
  frame(
    number: number,
    into?: TrackValues,
    options?: { signal?: AbortSignal },
  ): Promise<TrackValues>;
  /** A block for shaders. */
  fields(
    block: number,
    options?: { signal?: AbortSignal; columns?: readonly number[] },
  ): Promise<TrackFields>;
}

/** What the other parts see of an open file; `ReelFile` is it. */
export interface OpenReel {
  readonly info: ReelInfo;
  readonly surface: Surface;
  /**
   * Positions of a frame: nVerts x 3 in model units, of the type of the file, into `into` where it
   * is given.
   */
  frame(
    number: number,
    into?: Float32Array | Float64Array,
    options?: { signal?: AbortSignal },
  ): Promise<Float32Array | Float64Array>;
  /** A block for shaders. */
  fields(block: number, options?: { signal?: AbortSignal }): Promise<BlockFields>;
  /** @throws InvalidInputError where there is none of this name. */
  track(name: string): OpenTrack;
  close(): void;
}
