// The bar of colours below a heat map: both ends with their numbers and unit, round numbers between.

import { HEAT, shortNumber } from "./map";
import { barWidth, paintBar } from "../color_bar";
import { part } from "../page";
import type { HeatInfo } from "../facts";

export class HeatBar {
  private readonly figure = part("heat-bar");
  private readonly caption = this.figure.querySelector("figcaption") as HTMLElement;
  private readonly canvas = this.figure.querySelector("canvas") as HTMLCanvasElement;
  private shown = "";

  /** Draws the bar from 0 to `hottest`; null hides it. `isClipped` where there may be more. */
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
    const stops = HEAT.map((color, i) => [i / (HEAT.length - 1), color] as const);
    paintBar(this.canvas, width, { stops, range: [0, hottest], ends, nTicks: 5, ink });
    this.figure.setAttribute(
      "aria-label",
      `Colours of ${heat.label}: violet at 0, green half-way, yellow from ${ends[1]}`,
    );
  }
}

/** Three digits that count. */
function rounded(value: number): string {
  return shortNumber(Number(value.toPrecision(3)));
}
