// What the colours of a track mean, over the picture: its name and unit, and the ends of its range.

import type { ColorLegend } from "../three/color/track_colors.js";
import { made } from "./parts.js";

/** Colours of the bar. */
const N_COLORS = 24;

/** Columns of up to so many have names of axes. */
const MOST_AXES = 3;

/** A small legend. */
export class Legend {
  readonly element = made("div", "legend");
  readonly #title = made("span", "title");
  readonly #bar = made("span", "colors");
  readonly #ends = [made("span", ""), made("span", "")];

  constructor() {
    this.element.hidden = true;
    this.element.setAttribute("role", "img");
    this.element.append(this.#title, this.#bar, made("span", "ends", ...this.#ends));
  }

  /**
   * Shows a legend; null hides it.
   *
   * @param nColumns - Of the track.
   */
  show(legend: ColorLegend | null, nColumns = 1): void {
    this.element.hidden = legend === null;
    if (!legend) return;
    const { name, unit, range, component, colorOf } = legend;
    const column = nColumns > MOST_AXES ? `column ${component}` : "xyz"[Number(component)];
    const word = typeof component === "number" ? column : component;
    const part = nColumns === 1 || component === "color" ? "" : `, ${word}`;
    const title = `${name}${part}${unit && ` (${unit})`}`;
    this.#title.textContent = title;
    this.#bar.hidden = this.#ends[0].hidden = this.#ends[1].hidden = range === null;
    if (!range) return this.element.setAttribute("aria-label", `Colours: ${title}`);
    const [low, high] = range;
    const colors = Array.from({ length: N_COLORS + 1 }, (_, i) => {
      return `rgb(${colorOf(low + ((high - low) * i) / N_COLORS)})`;
    });
    this.#bar.style.backgroundImage = `linear-gradient(to right, ${colors})`;
    const ends = range.map(short);
    ends.forEach((end, i) => (this.#ends[i].textContent = end));
    this.element.setAttribute("aria-label", `Colours: ${title} from ${ends.join(" to ")}`);
  }
}

/** A number with three digits that count. */
function short(value: number): string {
  const size = Math.abs(value);
  const isPlain = value === 0 || (size >= 1e-3 && size < 1e6);
  const rounded = Number(value.toPrecision(3));
  return isPlain ? String(rounded) : rounded.toExponential().replace("e+", "e");
}
