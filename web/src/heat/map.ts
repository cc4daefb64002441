// From numbers to colours: the same map as in the pictures of `meshreel render`.

/** Violet, blue, green, yellow: lightness rises evenly, for every kind of vision. */
export const HEAT: readonly (readonly [number, number, number])[] = [
  [65, 43, 120], [67, 57, 135], [66, 71, 149], [62, 87, 162], [57, 102, 170], [55, 118, 172],
  [54, 133, 173], [47, 149, 175], [46, 164, 172], [62, 177, 166], [80, 190, 160],
  [92, 204, 151], [113, 216, 137], [147, 225, 122], [183, 232, 109], [217, 237, 98],
  [250, 242, 94],
];

/** At most `nMost` round numbers in a range, its ends included where they are round. */
export function roundTicks(low: number, high: number, nMost: number): number[] {
  if (!(high > low)) return [low];
  const least = (high - low) / Math.max(1, nMost - 1);
  const power = 10 ** Math.floor(Math.log10(least));
  const factors = [1, 2, 5, 10];
  const spacing = power * (factors.find((factor) => factor * power >= least * (1 - 1e-9)) ?? 10);
  const first = Math.ceil(low / spacing - 1e-9);
  const last = Math.floor(high / spacing + 1e-9);
  const ticks = Array.from({ length: last - first + 1 }, (_, i) => (first + i) * spacing);
  return ticks.length > 1 ? ticks : [low, high];
}

/** A number with four digits that count, without trailing zeros. */
export function shortNumber(value: number): string {
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size < 1e-3 || size >= 1e5) return value.toExponential(2).replace(/\.?0+e/, "e");
  return String(Number(value.toPrecision(4)));
}
