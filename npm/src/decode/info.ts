// Facts of a stream, from its header and the sections before its first block.

import { UnsupportedVersionError } from "../errors.js";
import { blockSizeBytes } from "../stream/index_section.js";
import type { Stream } from "../stream/stream.js";
import type { ReelInfo } from "../types.js";
import { readPromise, readStart } from "./leading_numbers.js";

const METHODS = ["pca-qp", "pca", "pca-q", "v2v", "pca-qs", "blocks", "gft"];
/** The only method that is decoded here. */
export const REEL = 7;
const N_LAPLACIANS = 2;
const N_ORDERS = 3;

/**
 * Facts of a stream, but for its tracks.
 *
 * @throws UnsupportedVersionError where this build does not decode it.
 * @throws CorruptStreamError where its numbers cannot be.
 */
export function readInfo({ header, leading, places, starts }: Stream): Omit<ReelInfo, "tracks"> {
  const { method, laplacian, order } = header;
  if (method < METHODS.length) {
    throw new UnsupportedVersionError(
      `the stream is of method ${METHODS[method]}; pages decode reel only: encode the original ` +
        "again with --method reel",
    );
  }
  requireKnown("method", method, REEL + 1);
  requireKnown("laplacian", laplacian, N_LAPLACIANS);
  requireKnown("order", order, N_ORDERS);
  const { name, nVerts, nFaces, fps, origin, scale, vertexType } = header;
  return {
    ...{ name, nFrames: starts[places.length], nVerts, nFaces, fps },
    startS: readStart(leading),
    center: origin,
    diagonal: scale,
    promisePercent: readPromise(leading),
    numberType: vertexType === 4 ? "float32" : "float64",
    blocks: places.map((place, i) => ({
      start: starts[i],
      nFrames: place.nFrames,
      sizeBytes: blockSizeBytes(place),
    })),
  };
}

function requireKnown(what: string, code: number, count: number): void {
  if (code >= count) {
    throw new UnsupportedVersionError(`${what} ${code} is unknown to this build; upgrade meshreel`);
  }
}
