// Bars of colours below the picture: both ends with their texts, round numbers between.

import { roundTicks, shortNumber } from "./heat/map";

const MOST_WIDTH = 320;
const BAR = 14;
const HEIGHT = 34;
/** Between numbers. */
const GAP = 10;

/** What a bar shows. */
export interface BarLook {
  /** Places 0..1 of the bar, ascending, with red, green and blue. */
  readonly stops: readonly (readonly [place: number, color: readonly number[]])[];
  readonly range: readonly [low: number, high: number];
  /** Written at both ends. */
  readonly ends: readonly [first: string, last: string];
  readonly nTicks: number;
  readonly ink: string;
}

/** The width of bars in the window as it is. */
export function barWidth(): number {
  return Math.min(MOST_WIDTH, document.documentElement.clientWidth - 28);
}

/** Draws a bar. */
export function paintBar(
  canvas: HTMLCanvasElement,
  width: number,
  { stops, range: [low, high], ends: [first, last], nTicks, ink }: BarLook,
): void {
  const pixelRatio = Math.min(window.devicePixelRatio, 2);
  canvas.width = width * pixelRatio;
  canvas.height = HEIGHT * pixelRatio;
  canvas.style.width = `${width}px`;
  canvas.style.height = `${HEIGHT}px`;
  const pen = canvas.getContext("2d") as CanvasRenderingContext2D;
  pen.scale(pixelRatio, pixelRatio);
  const ramp = pen.createLinearGradient(0, 0, width, 0);
  for (const [place, color] of stops) ramp.addColorStop(place, `rgb(${color})`);
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
  const span = high - low || 1;
  for (const tick of roundTicks(low, high, nTicks)) {
    const x = (width * (tick - low)) / span;
    const text = shortNumber(Math.abs(tick) < 1e-9 * span ? 0 : tick);
    const half = pen.measureText(text).width / 2 + GAP;
    if (x - half < left || x + half > right) continue;
    pen.fillRect(x - 0.5, BAR, 1, 4);
    write(text, x, "center");
  }
}
