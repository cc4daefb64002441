// Estimates what a camera must frame, from a few frames.

import type { OpenReel, OpenSegments, Positions } from "../types.js";
import { Vector3 } from "../webgl/index.js";
import { Clock } from "../three/clock.js";

/** Limits of the sampled frames and positions, which keep the time below a tenth of a second. */
const [MAX_FRAMES, MAX_POSITIONS] = [32, 2 ** 19];

/** Margin around the sampled poses of a followed figure, so that the poses between them fit too. */
const POSE_MARGIN = 1.06;

/**
 * 13 directions, half of the neighbors of a cell in a 3 x 3 x 3 grid: the extreme points along them
 * suffice to frame all.
 */
const DIRECTIONS = [-1, 0, 1]
  .flatMap((x) => [-1, 0, 1].flatMap((y) => [-1, 0, 1].map((z) => new Vector3(x, y, z))))
  .slice(14);

/** Points that a camera must frame, in model units. */
export interface Framing {
  /** Extreme points of all frames, relative to the center of the file. */
  readonly swept: readonly Vector3[];
  /** Extreme points of the poses about their centroids; null if they are unknown. */
  readonly figure: readonly Vector3[] | null;
}

/** Return the corners of a box around a center, with these half extents. */
export function boxCorners(center: Vector3, x: number, y: number, z: number): Vector3[] {
  const signs = [1, -1];
  const corner = (i: number, j: number, k: number) => new Vector3(i * x, j * y, k * z).add(center);
  return signs.flatMap((i) => signs.flatMap((j) => signs.map((k) => corner(i, j, k))));
}

/**
 * Estimate what to frame from frames of one block of a segment.
 *
 * The sampled frames may miss extremes, but the diagonal of the box of all frames is known: the swept
 * points are scaled about the center to this diagonal. Some frames may exceed them.
 *
 * @param start - seconds, or a frame, in the block to sample
 * @throws like `OpenReel.frame`
 */
export async function estimateFraming(
  file: OpenSegments,
  start: number | { readonly frame: number },
  options?: { signal?: AbortSignal },
): Promise<Framing> {
  const { segments } = file;
  const { center, diagonal, nFrames, fps, times } = file.info;
  const first = typeof start === "number" ? new Clock(nFrames, fps, times).positionAt(start) : start.frame;
  const number = Math.max(0, segments.findLastIndex((one) => one.start <= first));
  const reel = await file.segment(number, options);
  const drawn = Uint32Array.from(new Set(reel.surface.triangles)); // other vertices are invisible
  const [swept, figure]: [Vector3[], Vector3[]] = [[], []];
  const half = [0, 0, 0]; // sides of the box of the sampled frames around the center
  const include = async (frame: number): Promise<void> => {
    const positions = await reel.frame(frame, null, options);
    const sum = [0, 0, 0];
    for (let i = 0; i < positions.length; i++) {
      sum[i % 3] += positions[i];
      half[i % 3] = Math.max(half[i % 3], Math.abs(positions[i] - center[i % 3]));
    }
    const centroid = new Vector3(...sum).multiplyScalar(3 / positions.length);
    for (const point of extremePoints(positions, drawn)) {
      figure.push(point.clone().sub(centroid).multiplyScalar(POSE_MARGIN));
      swept.push(point.sub(new Vector3(...center)));
    }
  };
  await Promise.all(Array.from(sampleFrames(reel, first - segments[number].start), include));
  const [all, sampled] = [diagonal / 2, Math.hypot(...half)];
  if (!(sampled > 0 && drawn.length)) return unknownFraming(all);
  for (const point of swept) point.multiplyScalar(Math.max(1, all / sampled));
  return { swept, figure };
}

/** Return the extreme points of vertices along `DIRECTIONS`. */
function extremePoints(positions: Positions, vertices: Uint32Array): Vector3[] {
  const point = (vertex: number) => new Vector3().fromArray(positions, 3 * vertex);
  return DIRECTIONS.flatMap(({ x, y, z }) => {
    let [lowest, highest, low, high] = [0, 0, Infinity, -Infinity];
    for (const vertex of vertices) {
      const at = 3 * vertex;
      const projection = x * positions[at] + y * positions[at + 1] + z * positions[at + 2];
      if (projection < low) [lowest, low] = [vertex, projection];
      if (projection > high) [highest, high] = [vertex, projection];
    }
    return [point(lowest), point(highest)];
  });
}

/** Return the framing of a model of which only half the diagonal is known; 0 counts as 1. */
export function unknownFraming(radius: number): Framing {
  const half = radius || 1;
  return { swept: boxCorners(new Vector3(), half, half, half), figure: null };
}

/** Return the bounding box of points. */
export function boundsOf(points: readonly Vector3[]): { low: Vector3; high: Vector3 } {
  const low = points.reduce((least, point) => least.min(point), points[0].clone());
  const high = points.reduce((most, point) => most.max(point), points[0].clone());
  return { low, high };
}

/** Return points around all that a turn about a vertical axis in their middle sweeps. */
export function turned(points: readonly Vector3[]): Vector3[] {
  const { low, high } = boundsOf(points);
  const center = low.clone().add(high).multiplyScalar(0.5);
  const side = Math.max(...points.map(({ x, z }) => Math.hypot(x - center.x, z - center.z)));
  return boxCorners(center, side, high.y - center.y, side);
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
