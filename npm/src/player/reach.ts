// How far the frames of a file reach, without decoding all.

import type { OpenReel } from "../types.js";

/** Of a block, at most so many frames and positions stand for all: below a tenth of a second. */
const [MOST_FRAMES, MOST_POSITIONS] = [16, 2 ** 19];

/** Half the sides of a box, along x, y and z. */
export type Reach = readonly [number, number, number];

/**
 * How far frames reach from the centre of the file, in model units, as some of a block tell.
 *
 * What these frames do not reach, others do: the diagonal of all is known. Of one block, each side
 * gets what the diagonal leaves room for, so that nothing is cut off between the frames that were
 * looked at. Of several that would be too much: their box is widened until its diagonal is that of
 * all, and some frames may reach farther. Above 0, also for a mesh that is a point.
 *
 * @param start - seconds, or a frame: that of the block
 * @throws what `OpenReel.frame` throws
 */
export async function reachOf(
  reel: OpenReel,
  start: number | { readonly frame: number },
  options?: { signal?: AbortSignal },
): Promise<Reach> {
  const { center, diagonal, blocks } = reel.info;
  const reach: [number, number, number] = [0, 0, 0];
  const widen = async (frame: number): Promise<void> => {
    const positions = await reel.frame(frame, undefined, options);
    for (let i = 0; i < positions.length; i++) {
      const distance = Math.abs(positions[i] - center[i % 3]);
      if (distance > reach[i % 3]) reach[i % 3] = distance;
    }
  };
  await Promise.all(Array.from(sampled(reel, start), widen));
  const [all, found] = [diagonal / 2, Math.hypot(...reach)];
  if (found === 0) return [all || 1, all || 1, all || 1];
  if (found >= all) return reach;
  const widened = (side: number): number =>
    blocks.length > 1 ? (side * all) / found : Math.sqrt(side ** 2 + all ** 2 - found ** 2);
  return [widened(reach[0]), widened(reach[1]), widened(reach[2])];
}

/**
 * Frames of a block, spread evenly, the first and the last among them. The last comes first: in
 * their order frames are taken for played, and the next block would be decoded meanwhile.
 */
function sampled({ info }: OpenReel, begin: number | { readonly frame: number }): Set<number> {
  const frame = typeof begin === "number" ? begin * info.fps : begin.frame;
  const block = info.blocks.findLast(({ start }) => start <= frame) ?? info.blocks[0];
  const { start, nFrames } = block;
  const most = Math.min(MOST_FRAMES, Math.floor(MOST_POSITIONS / info.nVerts));
  const count = Math.max(Math.min(most, nFrames), 2);
  const step = (nFrames - 1) / (count - 1);
  return new Set(Array.from({ length: count }, (_, i) => start + Math.round((count - 1 - i) * step)));
}
