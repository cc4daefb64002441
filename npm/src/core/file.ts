// Metadata of an open file: frames, blocks and tracks.

import { InvalidInputError, UnsupportedVersionError } from "../errors.js";
import type { ReelInfo, TrackInfo } from "../types.js";
import type { Library } from "./library.js";
import { NUMBER_TYPES } from "./numbers.js";
import { Struct } from "./struct.js";

const METHODS = ["pca-qp", "pca", "pca-q", "v2v", "pca-qs", "blocks", "gft", "reel", "lossless", "grid"];
const REEL = 7;
const KINDS = ["other", "vector", "velocity", "normal", "color", "uv", "scalar"] as const;
const DOMAINS = ["vertex", "face", "corner"] as const;
const STRUCT_BYTES = 64;

/** Consecutive frames that are decoded together. */
export interface Block {
  readonly start: number;
  readonly nFrames: number;
  /** Compressed size of all tracks in the block. */
  readonly sizeBytes: number;
}

/** Metadata of a track. */
export interface Track {
  readonly info: TrackInfo;
  /** Number type, a `meshreel_type`. */
  readonly type: number;
}

/** Metadata of an open file. Track 0 is the positions. */
export interface File {
  /** Address of the `meshreel_file`. */
  readonly handle: number;
  readonly info: Omit<ReelInfo, "tracks" | "blocks">;
  readonly nPolygons: number;
  readonly blocks: readonly Block[];
  readonly tracks: readonly Track[];
}

/**
 * Read the metadata of a file that the library has opened.
 *
 * @throws InvalidInputError if the file has several segments.
 * @throws UnsupportedVersionError if the file uses a method that only the Python package decodes.
 */
export function readFile(library: Library, handle: number): File {
  const fields = new Struct(library.buffer, library.functions.meshreel_info_of(handle) >>> 0);
  const name = fields.text();
  const [fps, startS, maxErrorPercent, x, y, z, diagonal] = fields.float64s(7);
  fields.uint64(); // size
  const [nFrames, nVerts, nFaces, nPolygons, , nBlocks, , nTracks, numberBytes, method] =
    fields.uint32s(10);
  const [, , , nSegments] = fields.uint32s(4);
  if (nSegments > 1) {
    throw new InvalidInputError(
      `the file has ${nSegments} segments; open one of them: segment 0 to ${nSegments - 1}`,
    );
  }
  if (method < REEL) {
    throw new UnsupportedVersionError(
      `the file uses the method ${METHODS[method]}; this package decodes reel, lossless and grid: ` +
      "encode the original again",
    );
  }
  const blocksByTrack = Array.from({ length: nBlocks }, (_, block) =>
    Array.from({ length: nTracks }, (_, track) => readBlock(library, handle, block, track)),
  );
  const totalBytes = (ofBlocks: readonly Block[]): number =>
    ofBlocks.reduce((total, { sizeBytes }) => total + sizeBytes, 0);
  return {
    handle,
    info: {
      method: METHODS[method] as ReelInfo["method"],
      ...{ name, nFrames, nVerts, nFaces, fps, startS, center: [x, y, z], diagonal },
      maxErrorPercent: maxErrorPercent || null,
      numberType: numberBytes === 4 ? "float32" : "float64",
    },
    nPolygons,
    blocks: blocksByTrack.map((ofTracks) => ({ ...ofTracks[0], sizeBytes: totalBytes(ofTracks) })),
    tracks: Array.from({ length: nTracks }, (_, track) =>
      readTrack(library, handle, track, totalBytes(blocksByTrack.map((ofTracks) => ofTracks[track]))),
    ),
  };
}

/** Read the frame range of a block and the size of one track in it. */
function readBlock(library: Library, file: number, block: number, track: number): Block {
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
        promisedError: isExact ? 0 : bound || null,
        sizeBytes,
      },
    };
  });
}
