// The color legend of a track, an overlay: name, unit, color map and range.

import type { ColorLegend } from "../three/color/track_colors.js";
import { createElement } from "./dom.js";

/** Color stops of the gradient. */
const N_COLORS = 24;

/** Tracks with up to this many columns have columns named x, y and z. */
const MAX_AXES = 3;

/** A color legend. */
export class Legend {
  readonly element = createElement("div", "legend");
  readonly #title = createElement("span", "title");
  readonly #bar = createElement("span", "colors");
  readonly #ends = [createElement("span", ""), createElement("span", "")];

  constructor() {
    this.element.hidden = true;
    this.element.setAttribute("role", "img");
    this.element.append(this.#title, this.#bar, createElement("span", "ends", ...this.#ends));
  }

  /**
   * Show a legend; null hides it.
   *
   * @param nColumns - Columns of the track.
   */
  show(legend: ColorLegend | null, nColumns = 1): void {
    this.element.hidden = legend === null;
    if (!legend) return;
    const { name, unit, range, component, colorOf } = legend;
    const column = nColumns > MAX_AXES ? `column ${component}` : "xyz"[Number(component)];
    const word = typeof component === "number" ? column : component;
    const part = nColumns === 1 || component === "color" ? "" : `, ${word}`;
    const title = `${name}${part}${unit && ` (${unit})`}`;
    this.#title.textContent = title;
    this.#bar.hidden = this.#ends[0].hidden = this.#ends[1].hidden = range === null;
    if (!range) return this.element.setAttribute("aria-label", `Colors: ${title}`);
    const [low, high] = range;
    const colors = Array.from({ length: N_COLORS + 1 }, (_, i) => {
      return `rgb(${colorOf(low + ((high - low) * i) / N_COLORS)})`;
    });
    this.#bar.style.backgroundImage = `linear-gradient(to right, ${colors})`;
    const ends = range.map(formatNumber);
    ends.forEach((end, i) => (this.#ends[i].textContent = end));
    this.element.setAttribute("aria-label", `Colors: ${title} from ${ends.join(" to ")}`);
  }
}

/** Format a number with three significant digits. */
function formatNumber(value: number): string {
  const size = Math.abs(value);
  const isPlain = value === 0 || (size >= 1e-3 && size < 1e6);
  const rounded = Number(value.toPrecision(3));
  return isPlain ? String(rounded) : rounded.toExponential().replace("e+", "e");
}
