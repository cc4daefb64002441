// Plots a track at one vertex, face or corner over time.

import { formatNumber } from "../../player/axis_numbers.js";
import { withUnit } from "../../player/legend.js";
import type { ColorLegend } from "../../three/color/track_colors.js";

import type { Reel } from "../facts.js";
import { inputById, byId } from "../page.js";
import type { Picture } from "../picture.js";
import type { Player } from "../player.js";
import { Plot } from "../plots.js";
import { vertexOfItem, type Picked } from "./pick.js";

/** The plot of a track at one item. */
export class Probe {
  private readonly box = byId("probe");
  private readonly field = inputById("probe-item");
  private plot: Plot | null = null;
  private legend: ColorLegend | null = null;
  private label = "";
  private item: number | null = null;
  private readController: AbortController | null = null;

  constructor(
    private readonly reel: Reel,
    private readonly picture: Picture,
    private readonly player: Player,
  ) {
    byId("probe-close").addEventListener("click", () => this.plotItem(null));
    this.field.addEventListener("change", () => {
      this.plotItem(this.field.value === "" ? null : Number(this.field.value));
    });
  }

  /** Plot the shown track at a picked item. */
  pick(result: Picked | null): void {
    const domain = this.domain;
    if (result && domain) this.plotItem(result[domain]);
  }

  /** Set the track, or none; the plotted item is kept if the domain is the same. */
  setTrack(legend: ColorLegend | null, label: string): void {
    const previousDomain = this.domain;
    [this.legend, this.label] = [legend, label];
    const domain = this.domain;
    if (domain) {
      const { nItems } = this.reel.file.track(legend!.name).info;
      byId("probe-label").textContent = `Plot at ${domain}`;
      this.field.max = String(nItems - 1);
    }
    this.plotItem(domain === previousDomain ? this.item : null);
  }

  update(frame: number, writesValues: boolean): void {
    this.plot?.update(frame, writesValues);
  }

  /** The plotted values, for tests; null without a plot. */
  get values(): readonly (number | null)[] | null {
    return this.plot?.values ?? null;
  }

  private get domain(): keyof Picked | null {
    if (!this.legend) return null;
    return this.reel.file.track(this.legend.name).info.domain;
  }

  private plotItem(item: number | null): void {
    this.readController?.abort();
    this.item = item;
    this.plot = null;
    this.field.value = item === null ? "" : String(item);
    this.box.hidden = item === null || !this.legend;
    this.picture.setMarker(null);
    this.player.redraw();
    if (item === null || !this.legend) return;
    const { signal } = (this.readController = new AbortController());
    void this.read(this.legend, item, signal).catch((error: Error) => {
      if (signal.aborted) return;
      this.box.hidden = true;
      this.player.onError(error);
    });
  }

  private async read(legend: ColorLegend, item: number, signal: AbortSignal): Promise<void> {
    const { file } = this.reel;
    const track = file.track(legend.name);
    const { nItems, nColumns, domain } = track.info;
    if (!(Number.isInteger(item) && item >= 0 && item < nItems)) {
      throw new Error(`The number of a ${domain} must be 0 to ${nItems - 1}; got ${item}.`);
    }
    const isColor = legend.component === "color";
    const title = `${this.label} at ${domain} ${item}`;
    byId("probe-title").textContent = title;
    byId("probe-plot").replaceChildren();
    const status = byId("probe-status");
    const values: (number | null)[] = [];
    for (let frame = 0; frame < file.info.nFrames; frame++) {
      if (frame % 20 === 0) status.textContent = `Reading frame ${frame} of ${file.info.nFrames}`;
      const frameValues = await track.frame(frame, null, { signal });
      const row = Array.from({ length: nColumns }, (_, c) => Number(frameValues[item * nColumns + c]));
      const value = selectedNumber(row, legend.component);
      values.push(Number.isFinite(value) ? value : null);
    }
    signal.throwIfAborted();
    const finite = values.filter((value) => value !== null);
    const ends = [Math.min(...finite), Math.max(...finite)].map((end) => withUnit(formatNumber(end), legend.unit));
    status.textContent = finite.length
      ? `${ends.join(" to ")} in frames 0 to ${file.info.nFrames - 1}`
      : "No value at any frame";
    const seek = (frame: number) => void this.player.seek(frame).catch(this.player.onError);
    const unit = legend.unit ? `, ${legend.unit}` : "";
    const label = isColor ? "mean of red, green and blue" : `${this.label}${unit}`;
    const info = { label, values, isTrack: true };
    this.plot = new Plot(info, seek);
    byId("probe-plot").replaceChildren(this.plot.figure);
    this.picture.setMarker(vertexOfItem(this.picture.mesh, domain, item));
    this.player.redraw();
    this.plot.update(this.player.frame, true);
  }
}

/** Return the component of a row; for colors the mean of red, green and blue. */
function selectedNumber(row: readonly number[], component: ColorLegend["component"]): number {
  if (component === "magnitude") return Math.hypot(...row);
  if (component === "color") return (row[0] + row[1] + row[2]) / 3;
  return row[component];
}
