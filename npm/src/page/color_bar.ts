// Draws color bars: a label at each end, and ticks at round numbers between.

import { roundTicks, formatNumber } from "./heat/map.js";

const MAX_WIDTH = 320;
const BAR_HEIGHT = 14;
const HEIGHT = 34;
/** Minimum distance between labels, in pixels. */
const LABEL_GAP = 10;

/** What a bar displays. */
export interface BarOptions {
  /** Positions 0..1 in ascending order, with red, green and blue. */
  readonly stops: readonly (readonly [position: number, color: readonly number[]])[];
  readonly range: readonly [low: number, high: number];
  /** Labels of both ends. */
  readonly ends: readonly [first: string, last: string];
  readonly nTicks: number;
  readonly ink: string;
}

/** Width of color bars in the current window, in pixels. */
export function barWidth(): number {
  return Math.min(MAX_WIDTH, document.documentElement.clientWidth - 28);
}

/** Draw a color bar. */
export function paintBar(
  canvas: HTMLCanvasElement,
  width: number,
  { stops, range: [low, high], ends: [first, last], nTicks, ink }: BarOptions,
): void {
  const pixelRatio = Math.min(window.devicePixelRatio, 2);
  canvas.width = width * pixelRatio;
  canvas.height = HEIGHT * pixelRatio;
  canvas.style.width = `${width}px`;
  canvas.style.height = `${HEIGHT}px`;
  const context = canvas.getContext("2d") as CanvasRenderingContext2D;
  context.scale(pixelRatio, pixelRatio);
  const ramp = context.createLinearGradient(0, 0, width, 0);
  for (const [position, color] of stops) ramp.addColorStop(position, `rgb(${color})`);
  context.fillStyle = ramp;
  context.fillRect(0, 0, width, BAR_HEIGHT);
  context.fillStyle = ink;
  context.font = "12px system-ui, sans-serif";
  const write = (text: string, x: number, align: CanvasTextAlign) => {
    context.textAlign = align;
    context.fillText(text, x, HEIGHT - 5);
  };
  write(first, 0, "left");
  write(last, width, "right");
  const [left, right] = [context.measureText(first).width, width - context.measureText(last).width];
  const span = high - low || 1;
  for (const tick of roundTicks(low, high, nTicks)) {
    const x = (width * (tick - low)) / span;
    const text = formatNumber(Math.abs(tick) < 1e-9 * span ? 0 : tick);
    const half = context.measureText(text).width / 2 + LABEL_GAP;
    if (x - half < left || x + half > right) continue;
    context.fillRect(x - 0.5, BAR_HEIGHT, 1, 4);
    write(text, x, "center");
  }
}
