// The color bar of a heat map.

import { HEAT_COLORS, formatNumber } from "./map.js";
import { barWidth, paintBar } from "../color_bar.js";
import { byId } from "../page.js";
import type { HeatInfo } from "../facts.js";

/** The color bar of a heat map. */
export class HeatBar {
  private readonly figure = byId("heat-bar");
  private readonly caption = this.figure.querySelector("figcaption") as HTMLElement;
  private readonly canvas = this.figure.querySelector("canvas") as HTMLCanvasElement;
  private shown = "";

  /** Draw the bar from 0 to `hottest`; null hides it. `isClipped`: values may be larger. */
  update(heat: HeatInfo | null, hottest: number, isClipped: boolean, modes: string): void {
    this.figure.hidden = heat === null;
    const ink = getComputedStyle(this.figure).color;
    const width = barWidth();
    const key = heat ? `${heat.kind} ${hottest} ${isClipped} ${modes} ${ink} ${width}` : "";
    if (key === this.shown) return;
    this.shown = key;
    if (!heat) return;
    this.caption.textContent = modes ? `${heat.label} (${modes})` : heat.label;
    const unit = heat.unit ? ` ${heat.unit}` : "";
    const ends = [`0${unit}`, `${isClipped ? "≥ " : ""}${rounded(hottest)}${unit}`] as const;
    const stops = HEAT_COLORS.map((color, i) => [i / (HEAT_COLORS.length - 1), color] as const);
    paintBar(this.canvas, width, { stops, range: [0, hottest], ends, nTicks: 5, ink });
    this.figure.setAttribute(
      "aria-label",
      `Colors of ${heat.label}: violet at 0, green half-way, yellow from ${ends[1]}`,
    );
  }
}

/** Format a value with three significant digits. */
function rounded(value: number): string {
  return formatNumber(Number(value.toPrecision(3)));
}
