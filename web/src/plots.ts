// Error of each frame as curves; a line marks the frame shown, and a click or a drag seeks.

import { shortNumber, roundTicks } from "./heat/map";
import { element } from "./page";
import type { PlotInfo } from "./facts";

const WIDTH = 280;
const HEIGHT = 92;
const LEFT = 44;
const BOTTOM = 16;
const TOP = 6;
const RIGHT = 6;
/** Values that span more than this are drawn on a log scale. */
const SPAN_OF_LOG = 50;

export class Plot {
  readonly figure = element("figure");
  private readonly output = element("output");
  private readonly svg: SVGSVGElement;
  // Apart from the curve: moving it draws nothing anew, which costs much without a graphics card.
  private readonly cursor = element("i");

  constructor(
    private readonly info: PlotInfo,
    seek: (frame: number) => void,
  ) {
    const axis = new Axis(info.values, info.isOfTrack ?? false);
    const caption = element("figcaption");
    caption.append(element("span", axis.isLog ? `${info.label} (log)` : info.label), this.output);
    this.svg = svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img" }) as SVGSVGElement;
    this.svg.setAttribute("aria-label", `${info.label}, frame by frame`);
    for (const tick of axis.ticks) {
      const y = axis.y(tick);
      this.svg.append(
        svg("line", { class: "grid", x1: LEFT, x2: WIDTH - RIGHT, y1: y, y2: y }),
        svg("text", { x: LEFT - 5, y: y + 3.5, "text-anchor": "end" }, shortNumber(tick)),
      );
    }
    for (const frame of roundTicks(0, info.values.length - 1, 6).map(Math.round)) {
      const x = this.x(frame);
      this.svg.append(svg("text", { x, y: HEIGHT - 2, "text-anchor": "middle" }, String(frame)));
    }
    this.svg.append(svg("path", { class: "curve", d: this.curve(axis) }));
    const field = element("div");
    field.append(this.svg, this.cursor);
    this.figure.append(caption, field);
    this.listen(seek);
  }

  /** What it shows. */
  get values(): readonly (number | null)[] {
    return this.info.values;
  }

  /** Moves the line to a frame; its value is written where there is time to read it. */
  update(frame: number, isWritten: boolean): void {
    this.cursor.style.transform = `translateX(${((100 * this.x(frame)) / WIDTH).toFixed(3)}%)`;
    if (!isWritten) return;
    const value = this.info.values[frame];
    this.output.textContent = value === null || value === undefined ? "–" : shortNumber(value);
  }

  private x(frame: number): number {
    const n = this.info.values.length;
    return LEFT + ((WIDTH - LEFT - RIGHT) * frame) / Math.max(1, n - 1);
  }

  private curve(axis: Axis): string {
    let isDown = false;
    return this.info.values
      .map((value, frame) => {
        const isShown = value !== null && Number.isFinite(value);
        const command = isShown
          ? `${isDown ? "L" : "M"}${this.x(frame).toFixed(2)} ${axis.y(value).toFixed(2)}`
          : "";
        isDown = isShown;
        return command;
      })
      .join("");
  }

  private listen(seek: (frame: number) => void): void {
    const follow = (event: PointerEvent) => {
      const { left, width } = this.svg.getBoundingClientRect();
      const x = ((event.clientX - left) / width) * WIDTH;
      const share = (x - LEFT) / (WIDTH - LEFT - RIGHT);
      const last = this.info.values.length - 1;
      seek(Math.round(Math.min(Math.max(0, share), 1) * last));
    };
    this.svg.addEventListener("pointerdown", (event) => {
      this.svg.setPointerCapture(event.pointerId);
      follow(event);
    });
    this.svg.addEventListener("pointermove", (event) => {
      if (this.svg.hasPointerCapture(event.pointerId)) follow(event);
    });
  }
}

/**
 * Where a value is drawn: errors linear from zero, or logarithmic where they span decades; tracks
 * from their least to their largest value.
 */
class Axis {
  readonly isLog: boolean;
  readonly ticks: number[];
  private readonly low: number;
  private readonly high: number;

  constructor(values: (number | null)[], isOfTrack: boolean) {
    const shown = values.filter((value) => value !== null && Number.isFinite(value)) as number[];
    const most = shown.reduce((a, b) => Math.max(a, b), 0) || 1;
    const least = shown.filter((value) => value > 0).reduce((a, b) => Math.min(a, b), most);
    this.isLog = !isOfTrack && most > SPAN_OF_LOG * least;
    if (isOfTrack) {
      const [low, high] = [Math.min(...shown), Math.max(...shown)];
      const room = shown.length ? 0.06 * (high - low) || Math.abs(low) / 2 || 0.5 : 0.5;
      [this.low, this.high] = shown.length ? [low - room, high + room] : [0, 1];
      this.ticks = roundTicks(this.low, this.high, 4);
    } else if (this.isLog) {
      this.low = Math.max(Math.floor(Math.log10(least)), Math.log10(most) - 8);
      this.high = Math.ceil(Math.log10(most));
      const decades = this.high - this.low;
      const spacing = Math.ceil(decades / 4);
      this.ticks = Array.from(
        { length: Math.floor(decades / spacing) + 1 },
        (_, i) => 10 ** (this.high - i * spacing),
      );
    } else {
      [this.low, this.high] = [0, most * 1.05];
      this.ticks = roundTicks(0, most, 4);
    }
  }

  y(value: number): number {
    const place = this.isLog ? Math.log10(Math.max(value, 10 ** this.low)) : value;
    const share = (place - this.low) / (this.high - this.low);
    return HEIGHT - BOTTOM - (HEIGHT - BOTTOM - TOP) * share;
  }
}

function svg(tag: string, attributes: Record<string, string | number>, text = ""): SVGElement {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, String(value));
  made.textContent = text;
  return made;
}
