// An open file: what it says of itself.

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

/** A run of frames that are decoded together. */
export interface Block {
  readonly start: number;
  readonly nFrames: number;
  /** Of all tracks. */
  readonly sizeBytes: number;
}

/** A track: what is known of it, and its type as the library has it. */
export interface Track {
  readonly info: TrackInfo;
  readonly type: number;
}

/** Facts of an open file; the positions are the first of its tracks. */
export interface File {
  /** Its address. */
  readonly handle: number;
  readonly info: Omit<ReelInfo, "tracks" | "blocks">;
  readonly nPolygons: number;
  readonly blocks: readonly Block[];
  readonly tracks: readonly Track[];
}

/**
 * Facts of a file that the library has opened.
 *
 * @throws InvalidInputError where it has several segments.
 * @throws UnsupportedVersionError where it is of a method of the paper.
 */
export function readFile(library: Library, handle: number): File {
  const found = new Struct(library.buffer, library.functions.meshreel_info_of(handle) >>> 0);
  const name = found.text();
  const [fps, startS, promisePercent, x, y, z, diagonal] = found.float64s(7);
  found.uint64();
  const [nFrames, nVerts, nFaces, nPolygons, , nBlocks, , nTracks, numberBytes, method] =
    found.uint32s(10);
  const [, , , nSegments] = found.uint32s(4);
  if (nSegments > 1) {
    throw new InvalidInputError(
      `the file has ${nSegments} segments, which differ in connectivity; open one of them: ` +
        `segment 0 to ${nSegments - 1}`,
    );
  }
  if (method < REEL) {
    throw new UnsupportedVersionError(
      `the file is of method ${METHODS[method]}; pages decode reel, lossless and grid: encode the ` +
        "original again",
    );
  }
  const parts = Array.from({ length: nBlocks }, (_, block) =>
    Array.from({ length: nTracks }, (_, track) => partOf(library, handle, block, track)),
  );
  const sum = (found: readonly Block[]): number =>
    found.reduce((all, { sizeBytes }) => all + sizeBytes, 0);
  return {
    handle,
    info: {
      method: METHODS[method] as ReelInfo["method"],
      ...{ name, nFrames, nVerts, nFaces, fps, startS, center: [x, y, z], diagonal },
      promisePercent: promisePercent || null,
      numberType: numberBytes === 4 ? "float32" : "float64",
    },
    nPolygons,
    blocks: parts.map((ofTracks) => ({ ...ofTracks[0], sizeBytes: sum(ofTracks) })),
    tracks: Array.from({ length: nTracks }, (_, track) =>
      trackOf(library, handle, track, sum(parts.map((ofTracks) => ofTracks[track]))),
    ),
  };
}

/** The frames of a block, and the bytes of a track in it. */
function partOf(library: Library, file: number, block: number, track: number): Block {
  return library.during(STRUCT_BYTES, (at) => {
    library.functions.meshreel_block_of(file, block, track, at);
    const found = new Struct(library.buffer, at);
    const [start, nFrames] = found.uint32s(2);
    found.uint64();
    return { start, nFrames, sizeBytes: found.uint64() };
  });
}

function trackOf(library: Library, file: number, track: number, sizeBytes: number): Track {
  return library.during(STRUCT_BYTES, (at) => {
    library.functions.meshreel_track_of(file, track, at);
    const found = new Struct(library.buffer, at);
    const [name, unit] = [found.text(), found.text()];
    const [kind, domain, type, nColumns, nItems, , isExact] = found.uint32s(8);
    const bound = found.float64();
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
