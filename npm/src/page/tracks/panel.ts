// The panel section that colors the mesh by a track.

import { type LegendContent, trackTitle } from "../../player/legend.js";
import { DEFAULT_RANGE } from "../../three/color/color_range.js";
import { KIND_ROWS } from "../../track_kinds.js";
import type { ColorLegend } from "../../three/color/track_colors.js";

import type { Reel, TrackSettings } from "../facts.js";
import { inputById, byId } from "../page.js";
import type { Picture } from "../picture.js";
import type { Player } from "../player.js";
import type { Picked } from "./pick.js";
import { Probe } from "./probe.js";

const CUSTOM_RANGE = "typed";

/** Limit of the columns for which the magnitude can be shown. */
const MAX_MAGNITUDE_COLUMNS = 3;

const RANGE_NOTES: Record<string, string> = {
  [DEFAULT_RANGE]: "colors end at the 2nd and 98th percentile",
  "0%:100%": "colors end at the smallest and the largest value",
};

export class TrackPanel {
  private readonly track = byId<HTMLSelectElement>("track");
  private readonly component = byId<HTMLSelectElement>("component");
  private readonly range = byId<HTMLSelectElement>("range");
  private readonly ends = [inputById("range-low"), inputById("range-high")];
  readonly probe: Probe;
  private settings: TrackSettings | null = null;
  private legend: ColorLegend | null = null;
  /** Additional text about the range. */
  private note = "";
  private lastWriteMs = 0;

  constructor(
    private readonly reel: Reel,
    picture: Picture,
    private readonly player: Player,
  ) {
    this.probe = new Probe(reel, picture, player);
    const isSegmented = reel.segments.segments.length > 1; // tracks cannot color several segments
    const tracks = isSegmented ? [] : reel.file.info.tracks;
    byId("tracks").hidden = tracks.length === 0;
    for (const { name, unit } of tracks) {
      this.track.append(new Option(unit ? `${name} (${unit})` : name, name));
    }
    const defaults = { component: null, range: null, colormap: null };
    this.track.addEventListener("change", () => {
      const track = this.track.value;
      this.choose(track === "" ? null : { track, ...defaults });
    });
    this.component.addEventListener("change", () => {
      // A custom range applies to the previous component only.
      const range = this.settings?.range?.includes("%") ? this.settings.range : null;
      this.change({ component: this.component.value, range });
    });
    this.range.addEventListener("change", () => this.chooseRange());
    for (const end of this.ends) end.addEventListener("change", () => this.applyCustomRange());
    player.parts.retryTrack = () => this.choose(this.settings);
  }

  /** Start to show a track, or none. */
  choose(settings: TrackSettings | null): void {
    void this.show(settings).catch(this.player.onError);
  }

  /** Show a track, or none; resolves once it is shown. */
  async show(settings: TrackSettings | null): Promise<void> {
    const previous = this.settings;
    this.settings = settings;
    try {
      const legend = await this.player.setTrack(settings);
      if (settings !== this.settings) return;
      this.setLegend(legend);
    } catch (error) {
      if (settings !== this.settings) return;
      this.settings = previous;
      await this.player.setTrack(previous).catch(() => {
        this.settings = null;
        this.setLegend(null);
      });
      this.updateControls();
      throw error;
    }
  }

  /** Select the next track of the list, or none. */
  next(): void {
    if (this.track.options.length < 2) return;
    this.track.selectedIndex = (this.track.selectedIndex + 1) % this.track.options.length;
    this.track.dispatchEvent(new Event("change"));
  }

  /** The legend of the shown track, or null. */
  get legendContent(): LegendContent | null {
    return this.legend && { ...this.legend, title: this.label, note: this.note };
  }

  pick(result: Picked | null): void {
    this.probe.pick(result);
  }

  update(frame: number, playing: boolean): void {
    if (this.settings && !this.player.hasTrack) {
      this.settings = null; // replaced by a heat map
      this.setLegend(null);
    }
    const now = performance.now();
    const writesValues = !playing || now - this.lastWriteMs > 200;
    if (writesValues) this.lastWriteMs = now;
    this.probe.update(frame, writesValues);
  }

  private change(changes: Partial<TrackSettings>): void {
    if (this.settings) this.choose({ ...this.settings, ...changes });
  }

  private chooseRange(): void {
    const { value } = this.range;
    byId("typed-range").hidden = value !== CUSTOM_RANGE;
    if (value !== CUSTOM_RANGE) return this.change({ range: value });
    const { range } = this.legend ?? {};
    if (!range) return;
    this.ends.forEach((end, i) => (end.value = String(Number(range[i].toPrecision(4)))));
    this.ends[0].focus();
    this.applyCustomRange();
  }

  private applyCustomRange(): void {
    const [low, high] = this.ends.map(({ value }) => value);
    const isRange = low !== "" && high !== "" && Number(low) < Number(high);
    this.ends[1].setCustomValidity(isRange ? "" : "The first number must be below the second.");
    if (isRange) this.change({ range: `${low}:${high}` });
    else this.ends[1].reportValidity();
  }

  private setLegend(legend: ColorLegend | null): void {
    this.legend = legend;
    this.updateControls();
    this.probe.setTrack(legend, this.label);
    this.player.onChange();
  }

  /** Update the controls to the current settings. */
  private updateControls(): void {
    const { settings, legend } = this;
    this.track.value = settings?.track ?? "";
    byId("track-options").hidden = settings === null;
    if (!settings || !legend) return;
    const { nColumns, kind } = this.reel.file.track(settings.track).info;
    const range = settings.range ?? KIND_ROWS[kind]?.range ?? DEFAULT_RANGE;
    const columns = Array.from({ length: nColumns }, (_, c) => formatComponent(c, nColumns));
    const components = nColumns <= MAX_MAGNITUDE_COLUMNS ? ["magnitude", ...columns] : columns;
    if (kind === "color") components.unshift("color");
    this.component.replaceChildren(...components.map((word) => new Option(componentLabel(word), word)));
    this.component.value = formatComponent(legend.component, nColumns);
    byId("component-row").hidden = nColumns === 1;
    this.note = (legend.range && RANGE_NOTES[range]) ?? "";
    byId("range-row").hidden = legend.range === null;
    const isListed = [...this.range.options].some(({ value }) => value === range);
    this.range.value = isListed ? range : CUSTOM_RANGE;
    byId("typed-range").hidden = isListed || legend.range === null;
    if (!isListed) {
      this.ends.forEach((end, i) => (end.value = String(Number(legend.range?.[i].toPrecision(6)))));
    }
  }

  /** Describe the shown quantity. */
  private get label(): string {
    if (!this.legend) return "";
    const { name, component } = this.legend;
    return trackTitle(name, component, this.reel.file.track(name).info.nColumns);
  }
}

/** Format a component, such as "y" for column 1. */
function formatComponent(component: ColorLegend["component"], nColumns: number): string {
  if (typeof component !== "number") return component;
  return nColumns > 1 && nColumns <= 3 ? "xyz"[component] : String(component);
}

function componentLabel(component: string): string {
  if (component === "color") return "colors";
  return /^\d+$/.test(component) ? `column ${component}` : component;
}
