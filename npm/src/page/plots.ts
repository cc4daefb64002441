// Plots of values over frames: a line marks the current frame, and clicking or dragging seeks.

import { formatNumber, roundTicks } from "../player/axis_numbers.js";
import { createElement } from "../player/dom.js";
import type { PlotInfo } from "./facts.js";

const WIDTH = 280;
const HEIGHT = 92;
const LEFT = 44;
const BOTTOM = 16;
const TOP = 6;
const RIGHT = 6;
/** Ratio of the largest to the smallest value above which the scale is logarithmic. */
const MIN_LOG_RATIO = 50;

export class Plot {
  readonly figure = createElement("figure", "");
  private readonly output = createElement("output", "");
  private readonly svg: SVGSVGElement;
  // Separate from the SVG: moving it does not repaint the curve, which is slow without a GPU.
  private readonly cursor = createElement("i", "");

  constructor(
    private readonly info: PlotInfo,
    seek: (frame: number) => void,
  ) {
    const axis = new Axis(info.values, info.isTrack ?? false);
    const label = createElement("span", "", axis.isLog ? `${info.label} (log)` : info.label);
    const caption = createElement("figcaption", "", label, this.output);
    this.svg = svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img" }) as SVGSVGElement;
    this.svg.setAttribute("aria-label", `${info.label}, frame by frame`);
    for (const tick of axis.ticks) {
      const y = axis.y(tick);
      this.svg.append(
        svg("line", { class: "grid", x1: LEFT, x2: WIDTH - RIGHT, y1: y, y2: y }),
        svg("text", { x: LEFT - 5, y: y + 3.5, "text-anchor": "end" }, formatNumber(tick)),
      );
    }
    for (const frame of roundTicks(0, info.values.length - 1, 6).map(Math.round)) {
      const x = this.x(frame);
      this.svg.append(svg("text", { x, y: HEIGHT - 2, "text-anchor": "middle" }, String(frame)));
    }
    this.svg.append(svg("path", { class: "curve", d: this.curve(axis) }));
    this.figure.append(caption, createElement("div", "", this.svg, this.cursor));
    this.listen(seek);
  }

  get values(): readonly (number | null)[] {
    return this.info.values;
  }

  /** Move the line to a frame, and write its value if `writesValues` is set. */
  update(frame: number, isWritten: boolean): void {
    this.cursor.style.transform = `translateX(${((100 * this.x(frame)) / WIDTH).toFixed(3)}%)`;
    if (!isWritten) return;
    const value = this.info.values[frame];
    this.output.textContent = value === null || value === undefined ? "–" : formatNumber(value);
  }

  private x(frame: number): number {
    const n = this.info.values.length;
    return LEFT + ((WIDTH - LEFT - RIGHT) * frame) / Math.max(1, n - 1);
  }

  private curve(axis: Axis): string {
    let isDrawing = false;
    return this.info.values
      .map((value, frame) => {
        const isShown = value !== null && Number.isFinite(value);
        const command = isShown
          ? `${isDrawing ? "L" : "M"}${this.x(frame).toFixed(2)} ${axis.y(value).toFixed(2)}`
          : "";
        isDrawing = isShown;
        return command;
      })
      .join("");
  }

  private listen(seek: (frame: number) => void): void {
    const seekToPointer = (event: PointerEvent) => {
      const { left, width } = this.svg.getBoundingClientRect();
      const x = ((event.clientX - left) / width) * WIDTH;
      const fraction = (x - LEFT) / (WIDTH - LEFT - RIGHT);
      const last = this.info.values.length - 1;
      seek(Math.round(Math.min(Math.max(0, fraction), 1) * last));
    };
    this.svg.addEventListener("pointerdown", (event) => {
      this.svg.setPointerCapture(event.pointerId);
      seekToPointer(event);
    });
    this.svg.addEventListener("pointermove", (event) => {
      if (this.svg.hasPointerCapture(event.pointerId)) seekToPointer(event);
    });
  }
}

/**
 * The vertical axis: linear from 0 for errors, or logarithmic if they span decades; from the minimum
 * to the maximum for tracks.
 */
class Axis {
  readonly isLog: boolean;
  readonly ticks: number[];
  private readonly low: number;
  private readonly high: number;

  constructor(values: (number | null)[], isTrack: boolean) {
    const shown = values.filter((value) => value !== null && Number.isFinite(value)) as number[];
    const maximum = shown.reduce((a, b) => Math.max(a, b), 0) || 1;
    const minimum = shown.filter((value) => value > 0).reduce((a, b) => Math.min(a, b), maximum);
    this.isLog = !isTrack && maximum > MIN_LOG_RATIO * minimum;
    if (isTrack) {
      const [low, high] = [Math.min(...shown), Math.max(...shown)];
      const margin = shown.length ? 0.06 * (high - low) || Math.abs(low) / 2 || 0.5 : 0.5;
      [this.low, this.high] = shown.length ? [low - margin, high + margin] : [0, 1];
      this.ticks = roundTicks(this.low, this.high, 4);
    } else if (this.isLog) {
      this.low = Math.max(Math.floor(Math.log10(minimum)), Math.log10(maximum) - 8);
      this.high = Math.ceil(Math.log10(maximum));
      const decades = this.high - this.low;
      const spacing = Math.ceil(decades / 4);
      this.ticks = Array.from(
        { length: Math.floor(decades / spacing) + 1 },
        (_, i) => 10 ** (this.high - i * spacing),
      );
    } else {
      [this.low, this.high] = [0, maximum * 1.05];
      this.ticks = roundTicks(0, maximum, 4);
    }
  }

  y(value: number): number {
    const position = this.isLog ? Math.log10(Math.max(value, 10 ** this.low)) : value;
    const fraction = (position - this.low) / (this.high - this.low);
    return HEIGHT - BOTTOM - (HEIGHT - BOTTOM - TOP) * fraction;
  }
}

function svg(tag: string, attributes: Record<string, string | number>, text = ""): SVGElement {
  const created = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) created.setAttribute(name, String(value));
  created.textContent = text;
  return created;
}
