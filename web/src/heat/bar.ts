// The bar of colours below a heat map: both ends with their numbers and unit, round numbers between.

import { HEAT, roundTicks, shortNumber } from "./map";
import { part } from "../page";
import type { HeatInfo } from "../facts";

const MOST_WIDTH = 320;
const BAR = 14;
const HEIGHT = 34;
/** Between numbers. */
const GAP = 10;

export class HeatBar {
  private readonly figure = part("heat-bar");
  private readonly caption = this.figure.querySelector("figcaption") as HTMLElement;
  private readonly canvas = this.figure.querySelector("canvas") as HTMLCanvasElement;
  private shown = "";

  /** Draws the bar from 0 to `hottest`; null hides it. `isClipped` where there may be more. */
  update(heat: HeatInfo | null, hottest: number, isClipped: boolean, modes: string): void {
    this.figure.hidden = heat === null;
    const ink = getComputedStyle(this.figure).color;
    const width = Math.min(MOST_WIDTH, document.documentElement.clientWidth - 28);
    const key = heat ? `${heat.kind} ${hottest} ${isClipped} ${modes} ${ink} ${width}` : "";
    if (key === this.shown) return;
    this.shown = key;
    if (!heat) return;
    this.caption.textContent = modes ? `${heat.label} (${modes})` : heat.label;
    const unit = heat.unit ? ` ${heat.unit}` : "";
    const ends = [`0${unit}`, `${isClipped ? "≥ " : ""}${rounded(hottest)}${unit}`];
    this.paint(width, hottest, ends, ink);
    this.figure.setAttribute(
      "aria-label",
      `Colours of ${heat.label}: violet at 0, green half-way, yellow from ${ends[1]}`,
    );
  }

  private paint(width: number, hottest: number, [first, last]: string[], ink: string): void {
    const pixelRatio = Math.min(window.devicePixelRatio, 2);
    this.canvas.width = width * pixelRatio;
    this.canvas.height = HEIGHT * pixelRatio;
    this.canvas.style.width = `${width}px`;
    this.canvas.style.height = `${HEIGHT}px`;
    const pen = this.canvas.getContext("2d") as CanvasRenderingContext2D;
    pen.scale(pixelRatio, pixelRatio);
    const ramp = pen.createLinearGradient(0, 0, width, 0);
    HEAT.forEach((color, i) => ramp.addColorStop(i / (HEAT.length - 1), `rgb(${color})`));
    pen.fillStyle = ramp;
    pen.fillRect(0, 0, width, BAR);
    pen.fillStyle = ink;
    pen.font = "12px system-ui, sans-serif";
    const write = (text: string, x: number, align: CanvasTextAlign) => {
      pen.textAlign = align;
      pen.fillText(text, x, HEIGHT - 5);
    };
    write(first, 0, "left");
    write(last, width, "right");
    const [left, right] = [pen.measureText(first).width, width - pen.measureText(last).width];
    for (const tick of roundTicks(0, hottest, 5)) {
      const [x, text] = [(width * tick) / (hottest || 1), shortNumber(tick)];
      const half = pen.measureText(text).width / 2 + GAP;
      if (x - half < left || x + half > right) continue;
      pen.fillRect(x - 0.5, BAR, 1, 4);
      write(text, x, "center");
    }
  }
}

/** Three digits that count. */
function rounded(value: number): string {
  return shortNumber(Number(value.toPrecision(3)));
}
