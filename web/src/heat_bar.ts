// The bar of colours beside a heat map, with round numbers and their unit.

import { HEAT, roundTicks, shortNumber } from "./heat_map";
import { part } from "./page";
import type { HeatInfo } from "./reel";

const WIDTH = 224;
const NARROW_WIDTH = 140;
const NARROW_PAGE = window.matchMedia("(max-width: 720px)");
const PAD = 12;
const BAR = 14;
const HEIGHT = 36;

export class HeatBar {
  private readonly figure = part("heat-bar");
  readonly canvas = this.figure.querySelector("canvas") as HTMLCanvasElement;
  private shown = "";

  /** Draws the bar from 0 to `hottest`; null hides it. */
  update(heat: HeatInfo | null, hottest: number): void {
    const ink = getComputedStyle(this.figure).color;
    const width = NARROW_PAGE.matches ? NARROW_WIDTH : WIDTH;
    const key = heat ? `${heat.kind} ${hottest} ${ink} ${width}` : "";
    if (key === this.shown) return;
    this.shown = key;
    this.figure.hidden = heat === null;
    if (!heat) return;
    const caption = this.figure.querySelector("figcaption") as HTMLElement;
    caption.textContent = heat.label;
    this.paint(width, hottest, heat.unit, ink);
    this.figure.setAttribute(
      "aria-label",
      `Colours of ${heat.label}: violet at 0, green half-way, yellow from ${shortNumber(hottest)} ${heat.unit}`,
    );
  }

  private paint(width: number, hottest: number, unit: string, ink: string): void {
    const scale = Math.min(window.devicePixelRatio, 2);
    this.canvas.width = width * scale;
    this.canvas.height = HEIGHT * scale;
    this.canvas.style.width = `${width}px`;
    this.canvas.style.height = `${HEIGHT}px`;
    const pen = this.canvas.getContext("2d") as CanvasRenderingContext2D;
    pen.scale(scale, scale);
    const ramp = pen.createLinearGradient(PAD, 0, width - PAD, 0);
    HEAT.forEach((color, i) => ramp.addColorStop(i / (HEAT.length - 1), `rgb(${color})`));
    pen.fillStyle = ramp;
    pen.fillRect(PAD, 0, width - 2 * PAD, BAR);
    pen.fillStyle = ink;
    pen.font = "11.5px system-ui, sans-serif";
    pen.textAlign = "center";
    for (const tick of roundTicks(0, hottest, 5)) {
      const x = PAD + ((width - 2 * PAD) * tick) / (hottest || 1);
      pen.fillRect(x - 0.5, BAR, 1, 4);
      pen.fillText(tick === 0 ? `0 ${unit}` : shortNumber(tick), x, BAR + 16);
    }
  }
}
