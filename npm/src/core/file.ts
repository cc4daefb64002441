// Metadata of an open file: segments, frames, blocks and tracks.

import { UnsupportedVersionError } from "../errors.js";
import { KINDS } from "../track_kinds.js";
import type { BlockInfo, FileInfo, ReelInfo, SegmentInfo, TrackInfo } from "../types.js";
import type { Library } from "./library.js";
import { copyNumbers, NUMBER_TYPES } from "./numbers.js";
import { Struct } from "./struct.js";

/** Methods that only the Python package decodes. The numbers of `METHODS` follow theirs. */
const OTHER_METHODS = ["pca-qp", "pca", "pca-q", "v2v", "pca-qs", "blocks", "gft"];
const METHODS = ["reel", "lossless", "grid"] as const;
const FIRST_METHOD = 7;
const DOMAINS = ["vertex", "face", "corner", "cell"] as const;
const STRUCT_BYTES = 64;
const FLOAT64 = 8;

/** Metadata of a track. */
export interface Track {
  readonly info: TrackInfo;
  /** Number type, a `meshreel_type`. */
  readonly type: number;
}

/** A segment, and the byte at which it begins. */
export interface StoredSegment extends SegmentInfo {
  readonly offset: number;
}

/** Metadata of a file with one segment, or of an open segment. Track 0 is the positions. */
export interface File {
  /** Address of the `meshreel_file`. */
  readonly handle: number;
  readonly info: Omit<ReelInfo, "tracks" | "blocks">;
  readonly nPolygons: number;
  /** Frames that are decoded together; the size is that of all tracks. */
  readonly blocks: readonly BlockInfo[];
  readonly tracks: readonly Track[];
}

/** Read the properties that all segments of a file share, and the metadata of each segment. */
export function readSegments(
  library: Library,
  handle: number,
): { info: FileInfo; segments: StoredSegment[] } {
  const { nSegments, name, nFrames, fps, startS, times, center, diagonal, damage } = readInfo(library, handle);
  const segments = Array.from({ length: nSegments }, (_, number) =>
    library.withMemory(STRUCT_BYTES, (address) => {
      library.functions.meshreel_segment_of(handle, number, address);
      const fields = new Struct(library.buffer, address);
      const [start, nFrames, nVerts, nFaces] = fields.uint32s(4);
      return { start, nFrames, nVerts, nFaces, offset: fields.uint64(), sizeBytes: fields.uint64() };
    }),
  );
  return { info: { name, nFrames, fps, startS, times, center, diagonal, damage }, segments };
}

/**
 * Read the metadata of a file with one segment, or of an open segment.
 *
 * @throws UnsupportedVersionError if the file uses a method that only the Python package decodes.
 */
export function readFile(library: Library, handle: number): File {
  const { method, nPolygons, nBlocks, nTracks, nSegments: _, ...info } = readInfo(library, handle);
  if (method < FIRST_METHOD) {
    throw new UnsupportedVersionError(
      `the file uses the method ${OTHER_METHODS[method]}; this package decodes reel, lossless and grid: ` +
      "encode the original again",
    );
  }
  const blocksByTrack = Array.from({ length: nBlocks }, (_, block) =>
    Array.from({ length: nTracks }, (_, track) => readBlock(library, handle, block, track)),
  );
  const totalBytes = (ofBlocks: readonly BlockInfo[]): number =>
    ofBlocks.reduce((total, { sizeBytes }) => total + sizeBytes, 0);
  return {
    handle,
    info: {
      ...info,
      method: METHODS[method - FIRST_METHOD],
    },
    nPolygons,
    blocks: blocksByTrack.map((ofTracks) => ({ ...ofTracks[0], sizeBytes: totalBytes(ofTracks) })),
    tracks: Array.from({ length: nTracks }, (_, track) =>
      readTrack(library, handle, track, totalBytes(blocksByTrack.map((ofTracks) => ofTracks[track]))),
    ),
  };
}

/** Read a `meshreel_info`. */
function readInfo(library: Library, handle: number) {
  const fields = new Struct(library.buffer, library.functions.meshreel_info_of(handle) >>> 0);
  const name = fields.text();
  const [fps, startS, errorBoundPercent, ...box] = fields.float64s(7);
  fields.uint64(); // size
  const [nFrames, nVerts, nFaces, nPolygons, , nBlocks, , nTracks, numberBytes, method] =
    fields.uint32s(10);
  const [, , isWhole, nSegments] = fields.uint32s(6);
  fields.uint32s(2); // code of the damage
  fields.float64s(2); // its offset and size
  const times = library.functions.meshreel_times_of(handle) >>> 0;
  return {
    times: times ? (copyNumbers(library.buffer, FLOAT64, times, nFrames) as Float64Array) : null,
    ...{ name, fps, startS, center: box.slice(0, 3) as [number, number, number], diagonal: box[3] },
    ...{ nFrames, nVerts, nFaces, nPolygons, nBlocks, nTracks, nSegments, method },
    errorBoundPercent: errorBoundPercent || null,
    damage: isWhole ? null : fields.cString(),
    numberType: numberBytes === 4 ? ("float32" as const) : ("float64" as const),
  };
}

/** Read the frame range of a block and the size of one track in it. */
function readBlock(library: Library, file: number, block: number, track: number): BlockInfo {
  return library.withMemory(STRUCT_BYTES, (address) => {
    library.functions.meshreel_block_of(file, block, track, address);
    const fields = new Struct(library.buffer, address);
    const [start, nFrames] = fields.uint32s(2);
    fields.uint64(); // offset
    return { start, nFrames, sizeBytes: fields.uint64() };
  });
}

function readTrack(library: Library, file: number, track: number, sizeBytes: number): Track {
  return library.withMemory(STRUCT_BYTES, (address) => {
    library.functions.meshreel_track_of(file, track, address);
    const fields = new Struct(library.buffer, address);
    const [name, unit] = [fields.text(), fields.text()];
    const [kind, domain, type, nColumns, nItems, , isExact] = fields.uint32s(8);
    const bound = fields.float64();
    return {
      type,
      info: {
        ...{ name, unit, kind: KINDS[kind], domain: DOMAINS[domain], nColumns, nItems },
        numberType: NUMBER_TYPES[type][0],
        isExact: isExact !== 0,
        errorBound: bound || (isExact ? 0 : null),
        sizeBytes,
      },
    };
  });
}
