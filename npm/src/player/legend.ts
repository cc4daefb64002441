// The color legend of a track or a heat map: title, color map, and values at round numbers.

import { formatNumber, roundTicks } from "./axis_numbers.js";
import { createElement } from "./dom.js";

/** Number of intervals between color stops of the gradient. */
const N_COLORS = 64;

/** Distance between ticks, and between their labels, in pixels. */
const [TICK_SPACING, LABEL_GAP] = [50, 8];

/** Tracks with up to this many columns have columns named x, y and z. */
const MAX_AXES = 3;

/** What a legend displays. */
export interface LegendContent {
  /** The shown quantity. */
  readonly title: string;
  readonly unit: string;
  /** Values at both ends of the color map; null if the values are colors. */
  readonly range: readonly [low: number, high: number] | null;
  /** Whether values above the range have the color of its end. */
  readonly isClipped?: boolean;
  /** Additional text, such as about the range. */
  readonly note?: string;
  /** Red, green and blue of a value, 0..255. */
  colorOf(value: number): readonly number[];
}

/** Return the title for a component of a track. */
export function trackTitle(name: string, component: number | string, nColumns: number): string {
  if (nColumns === 1 || component === "color") return name;
  if (typeof component === "string") return `${name}, ${component}`;
  return `${name}, ${nColumns > MAX_AXES ? `column ${component}` : "xyz"[component]}`;
}

/** A color legend. */
export class Legend {
  readonly element = createElement("div", "legend");
  readonly #title = createElement("span", "title");
  readonly #bar = createElement("span", "colors");
  readonly #ends = [createElement("span", ""), createElement("span", "")];
  readonly #values = createElement("span", "values", ...this.#ends);
  #content: LegendContent | null = null;
  /** Identifies the displayed content. */
  #key = "";

  constructor() {
    this.element.hidden = true;
    this.element.setAttribute("role", "img");
    this.element.append(this.#title, this.#bar, this.#values);
    new ResizeObserver(() => this.#placeTicks()).observe(this.#bar);
  }

  /** Show a legend; null hides it. */
  show(content: LegendContent | null): void {
    this.#content = content;
    this.element.hidden = content === null;
    if (!content) return;
    const { title, unit, range, isClipped, note } = content;
    const colors = range && colorStops(range, (value) => content.colorOf(value));
    const key = JSON.stringify([title, unit, range, isClipped, note, colors]);
    if (key === this.#key) return;
    this.#key = key;
    const text = note ? `${title}; ${note}` : title;
    this.#title.textContent = text;
    this.#bar.hidden = this.#values.hidden = range === null;
    if (!range || !colors) return this.element.setAttribute("aria-label", `Colors: ${text}`);
    this.#bar.style.backgroundImage = `linear-gradient(to right, ${colors})`;
    const [low, high] = range.map((end) => formatNumber(end, 3));
    const last = withUnit(isClipped ? `≥ ${high}` : high, unit);
    [low, last].forEach((end, i) => (this.#ends[i].textContent = end));
    const noteText = note ? `; ${note}` : "";
    this.element.setAttribute("aria-label", `Colors: ${title} from ${withUnit(low, unit)} to ${last}${noteText}`);
    this.#placeTicks();
  }

  /** Draw the legend into a picture, with its upper left corner at the origin, in CSS pixels. */
  paint(context: CanvasRenderingContext2D): void {
    const { left, top, width, height } = this.element.getBoundingClientRect();
    const style = getComputedStyle(this.element);
    context.fillStyle = style.backgroundColor;
    context.fillRect(0, 0, width, height);
    const bar = this.#bar.getBoundingClientRect();
    const { range } = this.#content ?? {};
    if (range) {
      const ramp = context.createLinearGradient(bar.left - left, 0, bar.right - left, 0);
      const colors = colorStops(range, (value) => (this.#content as LegendContent).colorOf(value));
      colors.forEach((color, i) => ramp.addColorStop(i / N_COLORS, color));
      context.fillStyle = ramp;
      context.fillRect(bar.left - left, bar.top - top, bar.width, bar.height);
    }
    context.fillStyle = style.color;
    context.font = `${style.fontSize} ${style.fontFamily}`;
    context.textBaseline = "top";
    for (const part of [this.#title, ...this.#values.children]) {
      const place = part.getBoundingClientRect();
      context.fillText(part.textContent, place.left - left, place.top - top);
    }
  }

  /** Label round numbers between the ends, as far as there is space. */
  #placeTicks(): void {
    const { range } = this.#content ?? {};
    const [first, last] = this.#ends;
    this.#values.replaceChildren(first, last);
    const width = this.#bar.clientWidth;
    if (!range || !width) return;
    const [low, high] = range;
    const [left, right] = [first.offsetWidth, width - last.offsetWidth];
    for (const tick of roundTicks(low, high, Math.max(2, Math.floor(width / TICK_SPACING)))) {
      const label = createElement("span", "tick", formatNumber(tick));
      const x = (width * (tick - low)) / (high - low || 1);
      label.style.left = `${x}px`;
      this.#values.append(label);
      const half = label.offsetWidth / 2 + LABEL_GAP;
      if (x - half < left || x + half > right) label.remove();
    }
  }
}

function colorStops(
  [low, high]: readonly [number, number],
  colorOf: (value: number) => readonly number[],
): string[] {
  return Array.from({ length: N_COLORS + 1 }, (_, i) => {
    return `rgb(${colorOf(low + ((high - low) * i) / N_COLORS)})`;
  });
}

/** Append a unit to a number. */
export function withUnit(number: string, unit: string): string {
  return unit ? `${number} ${unit}` : number;
}
