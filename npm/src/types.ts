// Types that are shared by all modules of the package.

import type { KINDS } from "./track_kinds.js";

/** Random access to the bytes of a file. */
export interface ByteSource {
  /** Size in bytes; null while unknown. */
  readonly size: number | null;
  /** Whether a range can be read without reading all bytes before it. */
  readonly hasRanges: boolean;
  /**
   * Read the bytes `start` to `end - 1`, or fewer if the source ends before; returns a copy.
   *
   * @throws SourceError if they cannot be read, or if the file has changed.
   */
  read(start: number, end: number, signal?: AbortSignal): Promise<Uint8Array>;
  close(): void;
}

/** Positions: x, y and z of each vertex, in the number type of the file. */
export type Positions = Float32Array | Float64Array;

/** Metadata of a file with any number of segments. */
export interface FileInfo {
  readonly name: string;
  /** Number of frames of all segments. */
  readonly nFrames: number;
  /** Frames per second, the mean rate if there are `times`; 0 if unknown. */
  readonly fps: number;
  /** Time of the first frame in seconds. */
  readonly startS: number;
  /** Time of each frame in seconds, ascending; null if they are evenly spaced. */
  readonly times: Float64Array | null;
  /**
   * Center of the bounding box of all frames, in model units; of the first segment, if each segment
   * has its own box.
   */
  readonly center: readonly [number, number, number];
  /** Diagonal of that box. */
  readonly diagonal: number;
  /**
   * Why the end of the file is missing or damaged, although all frames of its complete blocks can be
   * decoded, as in a recording that continues; null if the file is whole.
   */
  readonly damage: string | null;
}

/** Metadata of a file with one segment, or of a segment. */
export interface ReelInfo extends FileInfo {
  /**
   * How positions are coded: "reel": as sums of modes; "lossless": exactly; "grid": on a grid.
   */
  readonly method: "reel" | "lossless" | "grid";
  readonly nVerts: number;
  /** Number of triangles. */
  readonly nFaces: number;
  /** Guaranteed bound of the error of any vertex, in percent of the diagonal; null if none, or 0. */
  readonly errorBoundPercent: number | null;
  readonly numberType: "float32" | "float64";
  /** Other quantities that change over time; `ReelFile.track` decodes their values. */
  readonly tracks: readonly TrackInfo[];
  /** Ranges of frames that `fields` returns. */
  readonly blocks: readonly BlockInfo[];
}

/** A segment of a file: an animated mesh of constant connectivity. */
export interface SegmentInfo {
  /** First frame, in the numbering of the file. */
  readonly start: number;
  readonly nFrames: number;
  readonly nVerts: number;
  /** Number of triangles. */
  readonly nFaces: number;
  /** Compressed size. */
  readonly sizeBytes: number;
}

/** A frame of a file with any number of segments. */
export interface MeshFrame {
  /** Index of its segment. */
  readonly segment: number;
  /** nVerts x 3 numbers of the type of the segment, in model units. */
  readonly positions: Positions;
  /** Vertex indices, three per triangle; the same array for all frames of an open segment. */
  readonly triangles: Uint32Array;
}

/** Elements of a mesh that have values: vertices, polygons, corners of polygons, cells. */
export type Domain = "vertex" | "face" | "corner" | "cell";

/** A track: a quantity of vertices, faces or corners that changes over time. */
export interface TrackInfo {
  readonly name: string;
  /** Unit, such as "Pa"; empty if unknown. */
  readonly unit: string;
  readonly kind: (typeof KINDS)[number];
  /** What has values. */
  readonly domain: Domain;
  /** Numbers per value. */
  readonly nColumns: number;
  /** Number of items of the domain. */
  readonly nItems: number;
  readonly numberType:
    | "float32"
    | "float64"
    /** Integers: exact tracks only. */
    | `${"u" | ""}int${8 | 16 | 32 | 64}`;
  /** Whether values are bit-identical to those of the source. */
  readonly isExact: boolean;
  /**
   * Guaranteed bound of the error of a value relative to the original; null if none. An exact track
   * has one if its source is lossy. The error is the length of the difference, in the unit of the
   * track; for normals the angle in degrees; for colors the difference of each number.
   */
  readonly errorBound: number | null;
  /** Compressed size in all blocks. */
  readonly sizeBytes: number;
}

/**
 * Values of a track, in an array of their number type; 64-bit integers are bigints. Missing values
 * are NaN.
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
 * A block of the file. Blocks of methods other than "reel" may have thousands of frames; they are
 * split into pieces of up to 32 frames.
 */
export interface BlockInfo {
  /** First frame. */
  readonly start: number;
  readonly nFrames: number;
  /** Compressed size; of a piece, its share of the block. */
  readonly sizeBytes: number;
}

/**
 * A block of frames as 16-bit fields and weights, for shaders.
 *
 * The position of vertex v at frame t of the block, relative to `ReelInfo.center` and in model
 * units, is in each axis the sum over modes k of
 * `fields[k * nVerts + v] * weights[(t * nModes + k) * 3 + axis]`, plus its correction. It differs
 * from the result of `frame` by less than 1e-5 of the diagonal. For methods other than "reel", each
 * axis of each frame is a mode, and the last mode is 1 everywhere.
 */
export interface BlockFields {
  /** Index in `ReelInfo.blocks`. */
  readonly index: number;
  /** First frame. */
  readonly start: number;
  readonly nFrames: number;
  readonly nModes: number;
  readonly nVerts: number;
  /** nModes x nVerts, vertices in file order. */
  readonly fields: Int16Array;
  /** Mean of each field over all vertices. */
  readonly means: Float64Array;
  /** nFrames x nModes x 3, multiplied by the quantization steps of the fields. */
  readonly weights: Float32Array;
  /** Corrections of frame t are correctionStarts[t] .. correctionStarts[t + 1] - 1. */
  readonly correctionStarts: Uint32Array;
  /** Vertex of each correction. */
  readonly correctionVertices: Uint32Array;
  /** Three numbers per correction, in model units. */
  readonly correctionOffsets: Float32Array;
}

/**
 * A track in a block as 16-bit fields and weights, for shaders.
 *
 * The value in column c of item i at frame t of the block is the sum over modes k of
 * `fields[k * nItems + i] * weights[(t * nModes + k) * nColumns + c]`, plus `origin[c]`, plus its
 * correction. Normals must still be normalized. Corrections of missing values are NaN. For tracks
 * that are exact or predicted from positions, each column of each frame is a mode, rounded to
 * 1/65534 of its range, and the last mode is 1 everywhere. For the rest see `BlockFields`, with
 * items in place of vertices.
 */
export interface TrackFields extends BlockFields {
  /** Number of requested columns; c indexes these. */
  readonly nColumns: number;
  /** Origin of each requested column. */
  readonly origin: readonly number[];
}

/** Values of the items of a domain that are the same in all frames: UVs, colors. */
export interface Attribute {
  readonly name: string;
  /** Colors are in sRGB, their fourth number is opacity: floats in 0..1, integers in 0..255. */
  readonly kind: "uv" | "color" | "other";
  readonly domain: Domain;
  /** Numbers per value. */
  readonly width: number;
  /** Rows of `width` numbers, one per item of the domain. */
  readonly values: Uint8Array | Int32Array | Float32Array | Float64Array;
}

/** An encoded image file; `OpenReel.image` reads it. */
export interface Image {
  readonly name: string;
  /** MIME type, such as "image/png". */
  readonly mediaType: string;
  readonly sizeBytes: number;
}

/** The texture of a slot of a material. */
export interface MaterialTexture {
  readonly slot: "baseColor" | "metallic" | "roughness" | "normal" | "occlusion" | "emissive";
  /** Index in `Surface.images`. */
  readonly image: number;
  /** Name of the UV attribute. */
  readonly uv: string;
  readonly offset: readonly [number, number];
  /** In radians. */
  readonly rotation: number;
  readonly scale: readonly [number, number];
  /** Wrap modes: 0 repeat, 1 mirror, 2 clamp, 3 black, 4 as set in the image (docs/format.md). */
  readonly wrapU: number;
  readonly wrapV: number;
}

/** A material with the parameters of glTF 2.0; its colors are linear. */
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

/** Cells of a volume mesh, such as hexahedra; the polygons are their surface. */
export interface Cells {
  /** Type of each cell, a number of VTK. */
  readonly types: Uint8Array;
  /** Vertices of the nodes of all cells, concatenated, in the order of VTK. */
  readonly nodes: Uint32Array;
  /** Cell of each polygon. */
  readonly faceCells: Uint32Array;
}

/** Polygons of the surface of cells, each a fan of triangles. */
export interface CellPolygons {
  /** Vertex indices, three per triangle. */
  readonly triangles: Uint32Array;
  /** Corners of each polygon. */
  readonly faceSizes: Uint32Array;
  /** Cell of each polygon. */
  readonly faceCells: Uint32Array;
}

/** A plane: the points whose dot product with `normal` is `offset`, in model units. */
export interface CutPlane {
  readonly normal: readonly [number, number, number];
  readonly offset: number;
}

/** Everything about a mesh but its positions; shared by all frames. */
export interface Surface {
  /** Vertex indices, three per triangle. */
  readonly triangles: Uint32Array;
  /** Corners of each polygon; null if all faces are triangles. */
  readonly faceSizes: Uint32Array | null;
  /** Polygon corner, numbered face by face, at each corner of the triangles; null if they are the same. */
  readonly triangleCorners: Uint32Array | null;
  readonly attributes: readonly Attribute[];
  /** Face groups, such as "material". `faceLabels` has the label index of each face; -1: none. */
  readonly groups: readonly {
    readonly name: string;
    readonly labels: readonly string[];
    readonly faceLabels: Int32Array;
  }[];
  readonly materials: readonly Material[];
  readonly images: readonly Image[];
  /**
   * Edges across which faces do not share normals: pairs of vertices, the lower index first; null if
   * the mesh has no hard edges.
   */
  readonly hardEdges: Uint32Array | null;
  /** Cells of a volume mesh; null if the mesh is a surface. */
  readonly cells: Cells | null;
}

/** A track of an open file. */
export interface OpenTrack {
  readonly info: TrackInfo;
  /**
   * Decode the values of a frame: nItems x nColumns numbers of the type of the track. They are stored
   * in `target`, and it is returned, if it is not null.
   */
  frame(index: number, target?: TrackValues | null, options?: { signal?: AbortSignal }): Promise<TrackValues>;
  /** Decode a block for shaders. */
  fields(
    block: number,
    options?: { signal?: AbortSignal; columns?: readonly number[] },
  ): Promise<TrackFields>;
}

/** A file with one segment, or one segment of a file; implemented by `ReelFile`. */
export interface OpenReel {
  readonly info: ReelInfo;
  readonly surface: Surface;
  /**
   * Decode the positions of a frame: nVerts x 3 numbers of the type of the file, in model units. They
   * are stored in `target`, and it is returned, if it is not null.
   */
  frame(index: number, target?: Positions | null, options?: { signal?: AbortSignal }): Promise<Positions>;
  /** Decode a block for shaders. */
  fields(block: number, options?: { signal?: AbortSignal }): Promise<BlockFields>;
  /** Return the surface of a volume mesh without the cells beyond a plane. */
  cut(plane: CutPlane, options?: { signal?: AbortSignal }): Promise<Surface>;
  /** Read the bytes of an image; `index` is that in `Surface.images`. */
  image(index: number, options?: { signal?: AbortSignal }): Promise<Uint8Array>;
  /** Return a track by name. @throws InvalidInputError if there is no track of this name. */
  track(name: string): OpenTrack;
  close(): void;
}

/** A file with any number of segments; implemented by `SegmentedReelFile`. */
export interface OpenSegments {
  readonly info: FileInfo;
  readonly segments: readonly SegmentInfo[];
  /** The first segment. */
  readonly first: OpenReel;
  /** Open a segment, whose frames are counted from 0. */
  segment(index: number, options?: { signal?: AbortSignal }): Promise<OpenReel>;
  close(): void;
}
