// Estimates the bounding box of all frames from a few of them.

import type { OpenReel, OpenSegments } from "../types.js";
import { Vector3 } from "../webgl/index.js";

/** Limits of the sampled frames and positions, which keep the time below a tenth of a second. */
const [MAX_FRAMES, MAX_POSITIONS] = [16, 2 ** 19];

/** Half the side lengths of a box around the center, along x, y and z. */
export type HalfExtents = readonly [number, number, number];

/** Corners of a box around the origin. */
export function boxCorners([x, y, z]: HalfExtents): Vector3[] {
  const signs = [1, -1];
  return signs.flatMap((i) => signs.flatMap((j) => signs.map((k) => new Vector3(i * x, j * y, k * z))));
}

/**
 * Estimate the half extents of all frames about the center of the file, in model units, from frames
 * of one block of a segment. They are above 0, even for a degenerate mesh.
 *
 * The sampled frames may miss extremes, but the diagonal of the box of all frames is known. In a
 * file of one block each side is extended as far as the diagonal allows, so that no frame is cut
 * off. With several blocks this would be too large: there the box is scaled to the diagonal, and
 * some frames may exceed it.
 *
 * @param start - seconds, or a frame, in the block to sample
 * @throws like `OpenReel.frame`
 */
export async function estimateHalfExtents(
  file: OpenSegments,
  start: number | { readonly frame: number },
  options?: { signal?: AbortSignal },
): Promise<HalfExtents> {
  const { segments } = file;
  const { center, diagonal, fps } = file.info;
  const first = typeof start === "number" ? start * fps : start.frame;
  const number = Math.max(0, segments.findLastIndex((one) => one.start <= first));
  const reel = await file.segment(number, options);
  const isWhole = segments.length === 1 && reel.info.blocks.length === 1;
  const extents: [number, number, number] = [0, 0, 0];
  const include = async (frame: number): Promise<void> => {
    const positions = await reel.frame(frame, options);
    for (let i = 0; i < positions.length; i++) {
      const distance = Math.abs(positions[i] - center[i % 3]);
      if (distance > extents[i % 3]) extents[i % 3] = distance;
    }
  };
  await Promise.all(Array.from(sampleFrames(reel, first - segments[number].start), include));
  const [all, found] = [diagonal / 2, Math.hypot(...extents)];
  if (found === 0) return [all || 1, all || 1, all || 1];
  if (found >= all) return extents;
  const extend = (side: number): number =>
    isWhole ? Math.sqrt(side ** 2 + all ** 2 - found ** 2) : (side * all) / found;
  return [extend(extents[0]), extend(extents[1]), extend(extents[2])];
}

/**
 * Select frames of a block at even distances, including the first and the last. They are returned
 * in descending order, since ascending requests would start prefetching the next block.
 */
function sampleFrames({ info }: OpenReel, frame: number): Set<number> {
  const block = info.blocks.findLast(({ start }) => start <= frame) ?? info.blocks[0];
  const { start, nFrames } = block;
  const maxFrames = Math.min(MAX_FRAMES, Math.floor(MAX_POSITIONS / info.nVerts));
  const count = Math.max(Math.min(maxFrames, nFrames), 2);
  const step = (nFrames - 1) / (count - 1);
  return new Set(Array.from({ length: count }, (_, i) => start + Math.round((count - 1 - i) * step)));
}
