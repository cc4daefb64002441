// What is given to shaders at once: a block of a stream, or a part of one whose frames are modes.

import { blockSizeBytes } from "../stream/index_section.js";
import type { Stream } from "../stream/stream.js";
import type { BlockInfo } from "../types.js";
import { REEL } from "./methods.js";

/** Frames of a part, so that weights, which grow with their square, stay few. */
const MOST_FRAMES = 32;
const LEAST_FRAMES = 8;

/** Of a part, where it has more frames than the least. */
const MOST_POSITIONS = 1 << 22;

/** Some frames of one block. */
export interface Piece extends BlockInfo {
  readonly block: number;
}

/** The pieces of a stream, in their order; `sizeBytes` of a part is its share of the block. */
export function piecesOf({ header, places, starts }: Stream): Piece[] {
  const { method, nVerts } = header;
  const few = Math.max(LEAST_FRAMES, Math.floor(MOST_POSITIONS / nVerts));
  const most = method === REEL ? Infinity : Math.min(MOST_FRAMES, few);
  const pieces: Piece[] = [];
  places.forEach((place, block) => {
    for (let start = starts[block]; start < starts[block + 1]; start += most) {
      const nFrames = Math.min(starts[block + 1] - start, most);
      const sizeBytes = Math.round((blockSizeBytes(place) * nFrames) / place.nFrames);
      pieces.push({ block, start, nFrames, sizeBytes });
    }
  });
  return pieces;
}
