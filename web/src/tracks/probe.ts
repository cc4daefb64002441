// A track at one vertex, face or corner over time: a small plot over the picture.

import type { ColorLegend } from "meshreel/three";

import type { Reel } from "../facts";
import { input, part } from "../page";
import type { Picture } from "../picture";
import type { Player } from "../player";
import { Plot } from "../plots";
import { withUnit } from "./bar";
import type { Domain } from "./items";
import { vertexOf, type Picked } from "./pick";

export class Probe {
  private readonly box = part("probe");
  private readonly field = input("probe-item");
  private plot: Plot | null = null;
  private legend: ColorLegend | null = null;
  private label = "";
  private item: number | null = null;
  private reading: AbortController | null = null;

  constructor(
    private readonly reel: Reel,
    private readonly picture: Picture,
    private readonly player: Player,
  ) {
    part("probe-close").addEventListener("click", () => this.show(null));
    this.field.addEventListener("change", () => {
      this.show(this.field.value === "" ? null : Number(this.field.value));
    });
  }

  /** Plots what is picked, of the track that is shown. */
  pick(picked: Picked | null): void {
    const domain = this.domain;
    if (picked && domain) this.show(picked[domain]);
  }

  /** Takes another track, or none; what is plotted stays at its place, if both have such ones. */
  take(legend: ColorLegend | null, label: string): void {
    const before = this.domain;
    [this.legend, this.label] = [legend, label];
    const domain = this.domain;
    if (domain) {
      const { nItems } = this.reel.file.track(legend!.name).info;
      part("probe-label").textContent = `Plot at ${domain}`;
      this.field.max = String(nItems - 1);
    }
    this.show(domain === before ? this.item : null);
  }

  update(frame: number, isWritten: boolean): void {
    this.plot?.update(frame, isWritten);
  }

  /** The values that are plotted, for tests; null: none. */
  get values(): readonly (number | null)[] | null {
    return this.plot?.values ?? null;
  }

  private get domain(): keyof Picked | null {
    if (!this.legend) return null;
    return this.reel.file.track(this.legend.name).info.domain as keyof Picked;
  }

  private show(item: number | null): void {
    this.reading?.abort();
    this.item = item;
    this.plot = null;
    this.field.value = item === null ? "" : String(item);
    this.box.hidden = item === null || !this.legend;
    this.picture.mark(null);
    this.player.redraw();
    if (item === null || !this.legend) return;
    const { signal } = (this.reading = new AbortController());
    void this.read(this.legend, item, signal).catch((error: Error) => {
      if (signal.aborted) return;
      this.box.hidden = true;
      this.player.failed(error);
    });
  }

  private async read(legend: ColorLegend, item: number, signal: AbortSignal): Promise<void> {
    const { file } = this.reel;
    const track = file.track(legend.name);
    const { nItems, nColumns, domain } = track.info;
    if (!(Number.isInteger(item) && item >= 0 && item < nItems)) {
      throw new Error(`The number of a ${domain} is 0 to ${nItems - 1}; got ${item}.`);
    }
    const isColor = legend.component === "color";
    const title = `${this.label} at ${domain} ${item}`;
    part("probe-title").textContent = title;
    part("probe-plot").replaceChildren();
    const status = part("probe-status");
    const values: (number | null)[] = [];
    for (let frame = 0; frame < file.info.nFrames; frame++) {
      if (frame % 20 === 0) status.textContent = `Reading frame ${frame} of ${file.info.nFrames}`;
      const found = await track.frame(frame, undefined, { signal });
      const row = Array.from({ length: nColumns }, (_, c) => Number(found[item * nColumns + c]));
      const value = numberOf(row, legend.component);
      values.push(Number.isFinite(value) ? value : null);
    }
    signal.throwIfAborted();
    const known = values.filter((value) => value !== null);
    const ends = [Math.min(...known), Math.max(...known)].map((end) => withUnit(end, legend.unit));
    status.textContent = known.length
      ? `${ends.join(" to ")} in frames 0 to ${file.info.nFrames - 1}`
      : "No value at any frame";
    const seek = (frame: number) => void this.player.seek(frame).catch(this.player.failed);
    const unit = legend.unit ? `, ${legend.unit}` : "";
    const what = isColor ? "mean of red, green and blue" : `${this.label}${unit}`;
    const info = { label: what, values, isOfTrack: true };
    this.plot = new Plot(info, seek);
    part("probe-plot").replaceChildren(this.plot.figure);
    this.picture.mark(vertexOf(this.picture.mesh, domain as Domain, item));
    this.player.redraw();
    this.plot.update(this.player.frame, true);
  }
}

/** The number that is shown of a row; of colours their lightness. */
function numberOf(row: readonly number[], component: ColorLegend["component"]): number {
  if (component === "magnitude") return Math.hypot(...row);
  if (component === "color") return (row[0] + row[1] + row[2]) / 3;
  return row[component];
}
