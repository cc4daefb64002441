// Pieces of a file for shaders: blocks, or parts of blocks whose frames are the modes.

import type { File } from "../core/file.js";
import type { BlockInfo } from "../types.js";

/** Frames of a part, so that weights, which grow with their square, stay few. */
const MAX_FRAMES = 32;
const MIN_FRAMES = 8;

/** Of a part, where it has more frames than the least. */
const MAX_POSITIONS = 1 << 22;

/** Some frames of one block. */
export interface Piece extends BlockInfo {
  readonly block: number;
}

/** The pieces of a file, in order; `sizeBytes` of a part is its share of the block. */
export function piecesOf({ info, blocks }: Pick<File, "info" | "blocks">): Piece[] {
  const few = Math.max(MIN_FRAMES, Math.floor(MAX_POSITIONS / info.nVerts));
  const most = info.method === "reel" ? Infinity : Math.min(MAX_FRAMES, few);
  const pieces: Piece[] = [];
  blocks.forEach((block, number) => {
    const end = block.start + block.nFrames;
    for (let start = block.start; start < end; start += most) {
      const nFrames = Math.min(end - start, most);
      const sizeBytes = Math.round((block.sizeBytes * nFrames) / block.nFrames);
      pieces.push({ block: number, start, nFrames, sizeBytes });
    }
  });
  return pieces;
}
