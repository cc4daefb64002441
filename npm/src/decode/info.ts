// Facts of a stream, from its header and the sections before its first block.

import { UnsupportedVersionError } from "../errors.js";
import type { Stream } from "../stream/stream.js";
import type { ReelInfo } from "../types.js";
import { readPromise, readStart } from "./leading_numbers.js";
import { METHODS, REEL } from "./methods.js";
import { piecesOf } from "./pieces.js";

const N_LAPLACIANS = 3;
const N_ORDERS = 3;

/**
 * Facts of a stream, but for its tracks.
 *
 * @throws UnsupportedVersionError where this build does not decode it.
 * @throws CorruptStreamError where its numbers cannot be.
 */
export function readInfo(stream: Stream): Omit<ReelInfo, "tracks"> {
  const { header, leading, places, starts } = stream;
  const { method, laplacian, order } = header;
  requireKnown("method", method, METHODS.length);
  if (method < REEL) {
    throw new UnsupportedVersionError(
      `the stream is of method ${METHODS[method]}; pages decode reel, lossless and grid: encode the ` +
        "original again",
    );
  }
  requireKnown("laplacian", laplacian, N_LAPLACIANS);
  requireKnown("order", order, N_ORDERS);
  const { name, nVerts, nFaces, fps, origin, scale, vertexType } = header;
  return {
    method: METHODS[method] as ReelInfo["method"],
    ...{ name, nFrames: starts[places.length], nVerts, nFaces, fps },
    startS: readStart(leading),
    center: origin,
    diagonal: scale,
    promisePercent: readPromise(leading),
    numberType: vertexType === 4 ? "float32" : "float64",
    blocks: piecesOf(stream).map(({ start, nFrames, sizeBytes }) => ({ start, nFrames, sizeBytes })),
  };
}

function requireKnown(what: string, code: number, count: number): void {
  if (code >= count) {
    throw new UnsupportedVersionError(`${what} ${code} is unknown to this build; upgrade meshreel`);
  }
}
