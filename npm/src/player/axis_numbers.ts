// Round numbers for legends and plots.

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

/** Format a number with a number of significant digits, without trailing zeros. */
export function formatNumber(value: number, nDigits = 4): string {
  const size = Math.abs(value);
  const isPlain = value === 0 || (size >= 1e-3 && size < 1e6);
  const rounded = Number(value.toPrecision(nDigits));
  return isPlain ? String(rounded) : rounded.toExponential().replace("e+", "e");
}
