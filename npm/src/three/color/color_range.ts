// Selects the values of a track to show, and the range of the color map.

import { InvalidInputError } from "../../errors.js";
import { KIND_ROWS } from "../../track_kinds.js";
import type { BlockInfo, OpenTrack, ReelInfo, TrackInfo, TrackValues } from "../../types.js";

/** Limit of selected columns: the GPU computes sums of three components. */
const MAX_COLUMNS = 3;

/** Frames that are sampled for percentiles. */
const N_SAMPLED_FRAMES = 8;

/** Limit of values that are sampled from a frame. */
const MAX_SAMPLES_PER_FRAME = 65_536;

const AXES = ["x", "y", "z"];

/** Default range of the color map. */
export const DEFAULT_RANGE = "2%:98%";

/** A component of a value: a column index, an axis, or the length of up to three columns. */
export type Component = number | "x" | "y" | "z" | "magnitude";

/** Selected columns, shown as a number, by their magnitude, or as a color. */
export interface Selection {
  readonly columns: readonly number[];
  readonly as: "number" | "magnitude" | "color";
}

/**
 * Select the columns of a component. Default: the color of a color track, x of normals, and the
 * magnitude of two or three columns.
 *
 * @throws InvalidInputError if a track has no such component, or no default.
 */
export function selectColumns(
  { name, kind, nColumns }: Pick<TrackInfo, "name" | "kind" | "nColumns">,
  component: Component | undefined,
): Selection {
  const all = Array.from({ length: nColumns }, (_, column) => column);
  const usual = KIND_ROWS[kind]?.component;
  if ((component ?? usual) === "color") return { columns: [0, 1, 2], as: "color" };
  const axes = nColumns > 1 && nColumns <= MAX_COLUMNS ? AXES.slice(0, nColumns) : [];
  const requested = component ?? (nColumns === 1 ? 0 : (usual ?? "magnitude"));
  if (requested === "magnitude" && nColumns <= MAX_COLUMNS) return { columns: all, as: "magnitude" };
  const column = axes.includes(requested as string) ? axes.indexOf(requested as string) : requested;
  if (all.includes(column as number)) return { columns: [column as number], as: "number" };
  const names = nColumns <= MAX_COLUMNS ? [...axes, "magnitude"] : [];
  const others = names.map((axis) => `, "${axis}"`).join("");
  throw new InvalidInputError(
    `track ${JSON.stringify(name)} has ${nColumns} columns: component must be one of 0 to ` +
      `${nColumns - 1}${others}; got ${component}`,
  );
}

/** Return the number of an item that is shown; NaN if it is missing. */
export function selectedValue(values: TrackValues, from: number, { columns, as }: Selection): number {
  const numbers = columns.map((column) => Number(values[from + column]));
  return as === "magnitude" ? Math.hypot(...numbers) : numbers[0];
}

/** An end of a range: a number, or a percentile. */
interface RangeEnd {
  readonly amount: number;
  readonly isPercent: boolean;
}

/**
 * Parse a range: two numbers, or a string such as "0:500" or "2%:98%".
 *
 * @throws InvalidInputError if it is invalid.
 */
export function parseRange(range: readonly [number, number] | string): [RangeEnd, RangeEnd] {
  const parts = typeof range === "string" ? range.split(":") : range.map(String);
  const ends = parts.map((part) => {
    const isPercent = part.trim().endsWith("%");
    const digits = isPercent ? part.trim().slice(0, -1) : part;
    const amount = digits.trim() ? Number(digits) : NaN;
    const isValid = Number.isFinite(amount) && (!isPercent || (amount >= 0 && amount <= 100));
    return isValid ? { amount, isPercent } : null;
  });
  const [low, high] = ends;
  const isPair = ends.length === 2 && low && high;
  if (isPair && (low.amount < high.amount || low.isPercent !== high.isPercent)) {
    return [low, high];
  }
  throw new InvalidInputError(
    "range must be two finite numbers, low < high, or a string LOW:HIGH, each a number or a " +
      `percentile of 0% to 100%, such as 2%:98%; got ${range}`,
  );
}

/** Interpolated quantile of sorted numbers; `fraction` is in 0..1. */
function quantile(sorted: Float64Array, fraction: number): number {
  const at = fraction * (sorted.length - 1);
  const below = Math.floor(at);
  const above = Math.min(below + 1, sorted.length - 1);
  return sorted[below] + (at - below) * (sorted[above] - sorted[below]);
}

/**
 * Compute the range of the color map.
 *
 * Percentiles are estimated from eight evenly spaced frames of the first block, or of the whole
 * file; for the percentiles 0 and 100 of the whole file all frames are decoded. A percentile that
 * passes 0 by no more than the error bound of the track becomes 0. If two percentiles have opposite
 * signs, the range is symmetric about 0. The range of a constant track is centered at its value.
 *
 * @throws InvalidInputError if the low end is above the high end.
 * @throws like `OpenTrack.frame`
 */
export async function resolveRange(
  track: OpenTrack,
  { blocks, nFrames }: Pick<ReelInfo, "blocks" | "nFrames">,
  selection: Selection,
  [first, last]: readonly [RangeEnd, RangeEnd],
  wholeFile: boolean,
  signal: AbortSignal,
): Promise<[number, number]> {
  const ends = [first, last];
  if (!ends.some(({ isPercent }) => isPercent)) return [first.amount, last.amount];
  const all = { start: 0, nFrames };
  const isWhole = wholeFile && ends.some(({ amount, isPercent }) => isPercent && amount % 100 === 0);
  const count = isWhole ? nFrames : N_SAMPLED_FRAMES;
  const sorted = await sampleValues(track, wholeFile ? all : blocks[0], count, selection, signal);
  if (!sorted.length) return [0, 1]; // all values are missing
  const bounds = ends.map(({ amount, isPercent }) =>
    isPercent ? quantile(sorted, amount / 100) : amount,
  );
  const [low, high] = snapToZero(bounds, ends, valueErrorBound(track.info));
  if (ends.every(({ isPercent }) => isPercent) && low < 0 && high > 0) {
    const maxAbs = Math.max(-low, high);
    return [-maxAbs, maxAbs];
  }
  if (low < high) return [low, high];
  if (low > high) {
    throw new InvalidInputError(`the range of the track would be ${low} to ${high}; set another one`);
  }
  const half = Math.abs(low) / 2 || 0.5;
  return [low - half, high + half];
}

/** Error bound of a value, in its unit; 0 if unknown. */
function valueErrorBound({ kind, errorBound }: Pick<TrackInfo, "kind" | "errorBound">): number {
  return KIND_ROWS[kind]?.error === "angle" ? 0 : (errorBound ?? 0);
}

/**
 * Set percentiles to 0 whose sign may be due to the coding error: a track without negative values
 * must not appear to have some. If that applies to both ends, the range is 0 to the bound.
 */
function snapToZero(
  [low, high]: readonly number[],
  [first, last]: readonly RangeEnd[],
  bound: number,
): readonly number[] {
  if (bound === 0 || low > 0 || high < 0) return [low, high];
  const isLowError = first.isPercent && low >= -bound;
  const isHighError = last.isPercent && high <= bound;
  if (isLowError && isHighError) return [0, bound];
  return [isLowError ? 0 : low, isHighError ? 0 : high];
}

/** Sample values of evenly spaced frames; returns them in ascending order. */
async function sampleValues(
  track: OpenTrack,
  { start, nFrames }: Pick<BlockInfo, "start" | "nFrames">,
  count: number,
  selection: Selection,
  signal: AbortSignal,
): Promise<Float64Array> {
  const last = Math.min(count, nFrames) - 1;
  const { nColumns, nItems } = track.info;
  // All values are used if all frames are requested, so that the minimum and maximum are exact.
  const step = count === N_SAMPLED_FRAMES ? Math.ceil(nItems / MAX_SAMPLES_PER_FRAME) : 1;
  const perFrame: Float64Array[] = [];
  for (let i = 0; i <= last; i++) {
    const number = start + (last && Math.round((i * (nFrames - 1)) / last));
    const values = await track.frame(number, null, { signal });
    const samples: number[] = [];
    for (let item = 0; item < nItems; item += step) {
      const value = selectedValue(values, item * nColumns, selection);
      if (Number.isFinite(value)) samples.push(value);
    }
    const sorted = Float64Array.from(samples).sort();
    perFrame.push(sorted.length > N_QUANTILES && last >= N_SAMPLED_FRAMES ? thin(sorted) : sorted);
  }
  const joined = new Float64Array(perFrame.reduce((sum, { length }) => sum + length, 0));
  let to = 0;
  for (const sorted of perFrame) {
    joined.set(sorted, to);
    to += sorted.length;
  }
  return joined.sort();
}

/** Quantiles per frame that are kept if many frames are sampled. */
const N_QUANTILES = 1000;

/** Reduce sorted numbers to N_QUANTILES evenly spaced quantiles. */
function thin(sorted: Float64Array): Float64Array {
  return Float64Array.from({ length: N_QUANTILES }, (_, i) => quantile(sorted, i / (N_QUANTILES - 1)));
}
