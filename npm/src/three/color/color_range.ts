// Which numbers of a track are shown, and in which range.

import { InvalidInputError } from "../../errors.js";
import type { BlockInfo, OpenTrack, ReelInfo, TrackInfo, TrackValues } from "../../types.js";

/** Columns of a value that are shown at once: the axes of a sum on the GPU. */
const MOST_COLUMNS = 3;

/** Frames that say in which range a track is. */
const N_SAMPLES = 8;

/** Numbers of a frame that stand for all of them. */
const MOST_NUMBERS = 65_536;

const AXES = ["x", "y", "z"];

/** Where the colours end, where nothing is said. */
export const DEFAULT_RANGE = "2%:98%";

/** What is shown of a value: a column, by its number or axis, or the length of up to three. */
export type Component = number | "x" | "y" | "z" | "magnitude";

/** The columns that are shown: one, their magnitude, or as a colour. */
export interface Shown {
  readonly columns: readonly number[];
  readonly as: "number" | "magnitude" | "color";
}

/**
 * What is shown of a track: of colours these, of normals their x, of up to three columns the length,
 * where nothing else is said.
 *
 * @throws InvalidInputError where a track has no such component, or more than can be shown.
 */
export function shownOf(
  { name, kind, nColumns }: Pick<TrackInfo, "name" | "kind" | "nColumns">,
  component: Component | undefined,
): Shown {
  const all = Array.from({ length: nColumns }, (_, column) => column);
  if (component === undefined && kind === "color") return { columns: [0, 1, 2], as: "color" };
  const axes = nColumns > 1 && nColumns <= MOST_COLUMNS ? AXES.slice(0, nColumns) : [];
  const usual = nColumns === 1 ? 0 : kind === "normal" ? "x" : "magnitude";
  const wanted = component ?? usual;
  if (wanted === "magnitude" && nColumns <= MOST_COLUMNS) return { columns: all, as: "magnitude" };
  const column = axes.includes(wanted as string) ? axes.indexOf(wanted as string) : wanted;
  if (all.includes(column as number)) return { columns: [column as number], as: "number" };
  const words = nColumns <= MOST_COLUMNS ? [...axes, "magnitude"] : [];
  const others = words.map((one) => `, "${one}"`).join("");
  throw new InvalidInputError(
    `track ${JSON.stringify(name)} has ${nColumns} columns: component must be one of 0 to ` +
      `${nColumns - 1}${others}; got ${component}`,
  );
}

/** The number that is shown of an item; NaN where it has none. */
export function shownValue(values: TrackValues, from: number, { columns, as }: Shown): number {
  const found = columns.map((column) => Number(values[from + column]));
  return as === "magnitude" ? Math.hypot(...found) : found[0];
}

/** An end of a range: a number, or the number that so many percent of all are below. */
interface End {
  readonly amount: number;
  readonly isPercent: boolean;
}

/**
 * Both ends of a range: numbers, or a text such as "0:500" or "2%:98%".
 *
 * @throws InvalidInputError where it is none.
 */
export function rangeEnds(range: readonly [number, number] | string): [End, End] {
  const parts = typeof range === "string" ? range.split(":") : range.map(String);
  const ends = parts.map((part) => {
    const isPercent = part.trim().endsWith("%");
    const digits = isPercent ? part.trim().slice(0, -1) : part;
    const amount = digits.trim() ? Number(digits) : NaN;
    const isThere = Number.isFinite(amount) && (!isPercent || (amount >= 0 && amount <= 100));
    return isThere ? { amount, isPercent } : null;
  });
  const [low, high] = ends;
  const isPair = ends.length === 2 && low && high;
  if (isPair && (low.amount < high.amount || low.isPercent !== high.isPercent)) {
    return [low, high];
  }
  throw new InvalidInputError(
    "range must be two finite numbers, low < high, or a text LOW:HIGH, each a number or a " +
      `percentile of 0% to 100%, such as 2%:98%; got ${range}`,
  );
}

/** The number that a share of sorted numbers, 0..1, are below. */
function quantile(sorted: Float64Array, share: number): number {
  const at = share * (sorted.length - 1);
  const below = Math.floor(at);
  const above = Math.min(below + 1, sorted.length - 1);
  return sorted[below] + (at - below) * (sorted[above] - sorted[below]);
}

/**
 * The range of a track that is shown. Percentiles are of eight frames, evenly spaced, of its first
 * block, or of the whole file, and then of all frames where they are 0 or 100. A percentile that is
 * on the other side of 0 than the other end by no more than the error bound of the track is 0.
 * Symmetric about 0 where two percentiles lie on both sides of it; of a track that is the same everywhere, around that.
 *
 * @throws InvalidInputError where it leaves no room between its ends.
 * @throws what `OpenTrack.frame` throws
 */
export async function shownRange(
  track: OpenTrack,
  { blocks, nFrames }: Pick<ReelInfo, "blocks" | "nFrames">,
  shown: Shown,
  [first, last]: readonly [End, End],
  isOfFile: boolean,
  signal: AbortSignal,
): Promise<[number, number]> {
  const ends = [first, last];
  if (!ends.some(({ isPercent }) => isPercent)) return [first.amount, last.amount];
  const all = { start: 0, nFrames };
  const isWhole = isOfFile && ends.some(({ amount, isPercent }) => isPercent && amount % 100 === 0);
  const count = isWhole ? nFrames : N_SAMPLES;
  const sorted = await sampledNumbers(track, isOfFile ? all : blocks[0], count, shown, signal);
  if (!sorted.length) return [0, 1]; // there is no number
  const found = ends.map(({ amount, isPercent }) =>
    isPercent ? quantile(sorted, amount / 100) : amount,
  );
  const [low, high] = withoutErrorSign(found, ends, errorBound(track.info));
  if (ends.every(({ isPercent }) => isPercent) && low < 0 && high > 0) {
    const most = Math.max(-low, high);
    return [-most, most];
  }
  if (low < high) return [low, high];
  if (low > high) {
    throw new InvalidInputError(`the range of the track would be ${low} to ${high}; give another`);
  }
  const half = Math.abs(low) / 2 || 0.5;
  return [low - half, high + half];
}

/** How far a number may be from the original, in its own unit; 0 where that is not known. */
function errorBound({ kind, promisedError }: Pick<TrackInfo, "kind" | "promisedError">): number {
  return kind === "normal" ? 0 : (promisedError ?? 0); // that of normals is an angle
}

/**
 * Ends of a range in which a percentile is 0 where only the error of decoding may have put it on the
 * other side of 0: a track that is never negative must not look as if it were. Where both may be
 * such errors, the range is 0 to the bound.
 */
function withoutErrorSign(
  [low, high]: readonly number[],
  [first, last]: readonly End[],
  bound: number,
): readonly number[] {
  if (bound === 0 || low > 0 || high < 0) return [low, high];
  const isLowError = first.isPercent && low >= -bound;
  const isHighError = last.isPercent && high <= bound;
  if (isLowError && isHighError) return [0, bound];
  return [isLowError ? 0 : low, isHighError ? 0 : high];
}

/** Numbers that are shown in frames, evenly spaced, ascending. */
async function sampledNumbers(
  track: OpenTrack,
  { start, nFrames }: Pick<BlockInfo, "start" | "nFrames">,
  count: number,
  shown: Shown,
  signal: AbortSignal,
): Promise<Float64Array> {
  const last = Math.min(count, nFrames) - 1;
  const { nColumns, nItems } = track.info;
  // The least and the largest are always among them, where all frames are asked for.
  const step = count === N_SAMPLES ? Math.ceil(nItems / MOST_NUMBERS) : 1;
  const perFrame: Float64Array[] = [];
  for (let i = 0; i <= last; i++) {
    const number = start + (last && Math.round((i * (nFrames - 1)) / last));
    const values = await track.frame(number, undefined, { signal });
    const found: number[] = [];
    for (let item = 0; item < nItems; item += step) {
      const value = shownValue(values, item * nColumns, shown);
      if (Number.isFinite(value)) found.push(value);
    }
    const sorted = Float64Array.from(found).sort();
    perFrame.push(sorted.length > N_KEPT && last >= N_SAMPLES ? thinned(sorted) : sorted);
  }
  const joined = new Float64Array(perFrame.reduce((sum, { length }) => sum + length, 0));
  let to = 0;
  for (const sorted of perFrame) {
    joined.set(sorted, to);
    to += sorted.length;
  }
  return joined.sort();
}

/** So many numbers of a frame are kept of long files. */
const N_KEPT = 1000;

/** Sorted numbers that stand for more, the first and the last among them. */
function thinned(sorted: Float64Array): Float64Array {
  return Float64Array.from({ length: N_KEPT }, (_, i) => quantile(sorted, i / (N_KEPT - 1)));
}
