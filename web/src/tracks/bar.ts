// The legend of a track, below the picture: colours with numbers and unit, and what they are of.

import type { ColorLegend } from "meshreel/three";

import { barWidth, paintBar } from "../color_bar";
import { part } from "../page";
import { shortNumber } from "../heat/map";

/** Steps of the colours. */
const N_COLORS = 64;

export class TrackBar {
  private readonly figure = part("track-bar");
  private readonly caption = this.figure.querySelector("figcaption") as HTMLElement;
  private readonly canvas = this.figure.querySelector("canvas") as HTMLCanvasElement;
  private shown = "";

  /**
   * Shows the legend of a track; null hides it.
   *
   * @param label - What is shown, such as "stress, magnitude".
   * @param note - More about its range.
   */
  update(legend: ColorLegend | null, label: string, note: string): void {
    this.figure.hidden = legend === null;
    if (!legend) return;
    const ink = getComputedStyle(this.figure).color;
    const width = barWidth();
    const key = `${label} ${note} ${legend.range} ${legend.unit} ${ink} ${width}`;
    if (key === this.shown) return;
    this.shown = key;
    const { range, unit } = legend;
    this.canvas.hidden = range === null;
    this.caption.textContent = [label, note].filter(Boolean).join("; ");
    if (!range) {
      this.figure.setAttribute("aria-label", `The mesh has the colours of ${label}`);
      return;
    }
    const [low, high] = range.map((value) => withUnit(value, unit));
    const stops = Array.from({ length: N_COLORS + 1 }, (_, i) => {
      const place = i / N_COLORS;
      return [place, legend.colorOf(range[0] + (range[1] - range[0]) * place)] as const;
    });
    paintBar(this.canvas, width, { stops, range, ends: [low, high], nTicks: 6, ink });
    this.figure.setAttribute("aria-label", `Colours of ${label}: from ${low} to ${high}. ${note}`);
  }
}

/** A number with four digits that count, and its unit. */
export function withUnit(value: number, unit: string): string {
  return `${shortNumber(value).replace("e+", "e")}${unit ? ` ${unit}` : ""}`;
}
