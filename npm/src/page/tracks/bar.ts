// The legend of a track below the views.

import type { ColorLegend } from "../../three/index.js";

import { barWidth, paintBar } from "../color_bar.js";
import { byId } from "../page.js";
import { formatNumber } from "../heat/map.js";

/** Color stops of the bar. */
const N_COLORS = 64;

export class TrackBar {
  private readonly figure = byId("track-bar");
  private readonly caption = this.figure.querySelector("figcaption") as HTMLElement;
  private readonly canvas = this.figure.querySelector("canvas") as HTMLCanvasElement;
  private shown = "";

  /**
   * Show the legend of a track; null hides it.
   *
   * @param label - the quantity, such as "stress, magnitude"
   * @param note - additional text about the range
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
      this.figure.setAttribute("aria-label", `The mesh has the colors of ${label}`);
      return;
    }
    const [low, high] = range.map((value) => formatWithUnit(value, unit));
    const stops = Array.from({ length: N_COLORS + 1 }, (_, i) => {
      const place = i / N_COLORS;
      return [place, legend.colorOf(range[0] + (range[1] - range[0]) * place)] as const;
    });
    paintBar(this.canvas, width, { stops, range, ends: [low, high], nTicks: 6, ink });
    this.figure.setAttribute("aria-label", `Colors of ${label}: from ${low} to ${high}. ${note}`);
  }
}

/** Format a number with four significant digits and its unit. */
export function formatWithUnit(value: number, unit: string): string {
  return `${formatNumber(value).replace("e+", "e")}${unit ? ` ${unit}` : ""}`;
}
