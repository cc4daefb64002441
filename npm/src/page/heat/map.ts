// The color map of heat maps, as in `meshreel render`, and number formatting.

/** Violet, blue, green, yellow: perceptually uniform and safe for color-blind viewers. */
export const HEAT_COLORS: readonly (readonly [number, number, number])[] = [
  [65, 43, 120], [67, 57, 135], [66, 71, 149], [62, 87, 162], [57, 102, 170], [55, 118, 172],
  [54, 133, 173], [47, 149, 175], [46, 164, 172], [62, 177, 166], [80, 190, 160],
  [92, 204, 151], [113, 216, 137], [147, 225, 122], [183, 232, 109], [217, 237, 98],
  [250, 242, 94],
];

/** Return at most `maxCount` round numbers in a range. */
export function roundTicks(low: number, high: number, maxCount: number): number[] {
  if (!(high > low)) return [low];
  const minSpacing = (high - low) / Math.max(1, maxCount - 1);
  const power = 10 ** Math.floor(Math.log10(minSpacing));
  const factors = [1, 2, 5, 10];
  const spacing = power * (factors.find((factor) => factor * power >= minSpacing * (1 - 1e-9)) ?? 10);
  const first = Math.ceil(low / spacing - 1e-9);
  const last = Math.floor(high / spacing + 1e-9);
  const ticks = Array.from({ length: last - first + 1 }, (_, i) => (first + i) * spacing);
  return ticks.length > 1 ? ticks : [low, high];
}

/** Format a number with four significant digits, without trailing zeros. */
export function formatNumber(value: number): string {
  if (value === 0) return "0";
  const magnitude = Math.abs(value);
  if (magnitude < 1e-3 || magnitude >= 1e5) return value.toExponential(2).replace(/\.?0+e/, "e");
  return String(Number(value.toPrecision(4)));
}
