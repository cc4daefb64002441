// Points that suffice to frame a pose.

import { Vector3 } from "../webgl/index.js";

/** 13 directions: half of the neighbors of a cell in a 3 x 3 x 3 grid. */
const DIRECTIONS = [-1, 0, 1]
  .flatMap((x) => [-1, 0, 1].flatMap((y) => [-1, 0, 1].map((z) => new Vector3(x, y, z))))
  .slice(14);

/** Return the extreme positions of (V, 3) along 13 lines, which suffice to frame all. */
export function extremePoints(positions: Float32Array | Float64Array): Vector3[] {
  const point = (offset: number) => new Vector3().fromArray(positions, offset);
  return DIRECTIONS.flatMap(({ x, y, z }) => {
    let [lowest, highest, low, high] = [0, 0, Infinity, -Infinity];
    for (let at = 0; at < positions.length; at += 3) {
      const projection = x * positions[at] + y * positions[at + 1] + z * positions[at + 2];
      if (projection < low) [lowest, low] = [at, projection];
      if (projection > high) [highest, high] = [at, projection];
    }
    return [point(lowest), point(highest)];
  });
}
