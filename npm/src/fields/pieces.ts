// Splits blocks into pieces that are small enough for shaders.

import type { File } from "../core/file.js";
import type { BlockInfo } from "../types.js";

/** Frames of a piece without modes: every frame is a mode, so that weights grow with its square. */
const MAX_FRAMES = 32;
const MIN_FRAMES = 8;

/** Limit of nFrames * nVerts of a piece, unless it has only MIN_FRAMES frames. */
const MAX_POSITIONS = 1 << 22;

/** A block of the method reel, or up to MAX_FRAMES frames of a block of another method. */
export interface Piece extends BlockInfo {
  readonly block: number;
}

/** Return the pieces of a file in order; `sizeBytes` is divided in proportion to the frames. */
export function splitBlocks({ info, blocks }: Pick<File, "info" | "blocks">): Piece[] {
  const frameLimit = Math.max(MIN_FRAMES, Math.floor(MAX_POSITIONS / info.nVerts));
  const maxFrames = info.method === "reel" ? Infinity : Math.min(MAX_FRAMES, frameLimit);
  const pieces: Piece[] = [];
  blocks.forEach((block, number) => {
    const end = block.start + block.nFrames;
    for (let start = block.start; start < end; start += maxFrames) {
      const nFrames = Math.min(end - start, maxFrames);
      const sizeBytes = Math.round((block.sizeBytes * nFrames) / block.nFrames);
      pieces.push({ block: number, start, nFrames, sizeBytes });
    }
  });
  return pieces;
}
