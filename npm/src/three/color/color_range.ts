// Which numbers of a track are shown, and in which range.

import { InvalidInputError } from "../../errors.js";
import type { BlockInfo, OpenTrack, TrackInfo } from "../../types.js";

/** Columns of a value that are shown at once: the axes of a sum on the GPU. */
const MOST_COLUMNS = 3;

/** Frames of the first block that say in which range a track is. */
const N_SAMPLES = 8;

/** The columns that are shown, and whether it is their magnitude. */
export interface Shown {
  readonly columns: readonly number[];
  readonly isMagnitude: boolean;
}

/** @throws InvalidInputError where a track has no such component, or more than can be shown. */
export function shownOf(
  { name, nColumns }: TrackInfo,
  component: number | "magnitude" | undefined,
): Shown {
  const hasLength = nColumns <= MOST_COLUMNS;
  const all = Array.from({ length: nColumns }, (_, column) => column);
  const wanted = component ?? (nColumns === 1 ? 0 : "magnitude");
  if (wanted === "magnitude" && hasLength) return { columns: all, isMagnitude: true };
  if (all.includes(wanted as number)) return { columns: [wanted as number], isMagnitude: false };
  const magnitude = hasLength ? ' or "magnitude"' : "";
  throw new InvalidInputError(
    `track ${JSON.stringify(name)} has ${nColumns} columns: component must be one of 0 to ` +
      `${nColumns - 1}${magnitude}; got ${component}`,
  );
}

/** The number that is shown of an item; NaN where it has none. */
export function shownValue(values: ArrayLike<number>, from: number, shown: Shown): number {
  const found = shown.columns.map((column) => values[from + column]);
  return shown.isMagnitude ? Math.hypot(...found) : found[0];
}

/** The range that was given. @throws InvalidInputError where it is none. */
export function checkedRange(range: readonly [number, number]): [number, number] {
  const [low, high] = range;
  if (range.length === 2 && low < high && Number.isFinite(high - low)) return [low, high];
  throw new InvalidInputError(`range must be two finite numbers, low < high; got ${range}`);
}

/**
 * The least and the largest number in frames of the first block, evenly spaced; symmetric about 0
 * where there are numbers on both sides of it. Of a track that is the same everywhere, around that.
 *
 * @throws what `OpenTrack.frame` throws
 */
export async function sampledRange(
  track: OpenTrack,
  { start, nFrames }: BlockInfo,
  shown: Shown,
  signal: AbortSignal,
): Promise<[number, number]> {
  const last = Math.min(N_SAMPLES, nFrames) - 1;
  let [low, high] = [Infinity, -Infinity];
  for (let i = 0; i <= last; i++) {
    const number = start + (last && Math.round((i * (nFrames - 1)) / last));
    const values = await track.frame(number, undefined, { signal });
    for (let from = 0; from < values.length; from += track.info.nColumns) {
      const value = shownValue(values, from, shown);
      if (!Number.isFinite(value)) continue;
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  if (low > high) return [0, 1]; // there is no number
  if (low < 0 && high > 0) {
    const most = Math.max(-low, high);
    return [-most, most];
  }
  const half = low < high ? 0 : Math.abs(low) / 2 || 0.5;
  return [low - half, high + half];
}
