// The part of the panel that colours the mesh by a track.

import type { ColorLegend } from "meshreel/three";

import type { Reel } from "../facts";
import { input, part } from "../page";
import type { Picture } from "../picture";
import type { Player } from "../player";
import { TrackBar } from "./bar";
import { componentText, type TrackLook, USUAL_RANGE } from "./look";
import type { Picked } from "./pick";
import { Probe } from "./probe";

const TYPED = "typed";

/** Of at most so many columns the length can be shown. */
const MOST_OF_LENGTH = 3;

const RANGE_NOTES: Record<string, string> = {
  [USUAL_RANGE]: "colours end at the 2nd and 98th percentile",
  "0%:100%": "colours end at the smallest and the largest value",
};

export class TrackPanel {
  private readonly track = part<HTMLSelectElement>("track");
  private readonly component = part<HTMLSelectElement>("component");
  private readonly range = part<HTMLSelectElement>("range");
  private readonly ends = [input("range-low"), input("range-high")];
  private readonly bar = new TrackBar();
  readonly probe: Probe;
  private look: TrackLook | null = null;
  private legend: ColorLegend | null = null;
  /** More about the range of what is shown. */
  private note = "";
  private writtenMs = 0;

  constructor(
    private readonly reel: Reel,
    picture: Picture,
    private readonly player: Player,
  ) {
    this.probe = new Probe(reel, picture, player);
    const { tracks } = reel.file.info;
    part("tracks").hidden = tracks.length === 0;
    for (const { name, unit } of tracks) {
      this.track.append(new Option(unit ? `${name} (${unit})` : name, name));
    }
    const plain = { component: null, range: null, colormap: null };
    this.track.addEventListener("change", () => {
      const track = this.track.value;
      this.choose(track === "" ? null : { track, ...plain });
    });
    this.component.addEventListener("change", () => {
      // What is typed is of the component before.
      const range = this.look?.range?.includes("%") ? this.look.range : null;
      this.change({ component: this.component.value, range });
    });
    this.range.addEventListener("change", () => this.chooseRange());
    for (const end of this.ends) end.addEventListener("change", () => this.takeTyped());
  }

  /** Shows a track, or none. */
  choose(look: TrackLook | null): void {
    void this.show(look).catch(this.player.failed);
  }

  /** As `choose`; ends once it is shown. */
  async show(look: TrackLook | null): Promise<void> {
    const before = this.look;
    this.look = look;
    try {
      const legend = await this.player.setTrack(look);
      if (look !== this.look) return;
      this.take(legend);
    } catch (error) {
      if (look !== this.look) return;
      this.look = before;
      await this.player.setTrack(before).catch(() => {
        this.look = null;
        this.take(null);
      });
      this.write();
      throw error;
    }
  }

  /** Takes the next track of the list, or none. */
  next(): void {
    if (this.track.options.length < 2) return;
    this.track.selectedIndex = (this.track.selectedIndex + 1) % this.track.options.length;
    this.track.dispatchEvent(new Event("change"));
  }

  pick(picked: Picked | null): void {
    this.probe.pick(picked);
  }

  update(frame: number, playing: boolean): void {
    if (this.look && !this.player.hasTrack) {
      this.look = null; // a heat map has taken its place
      this.take(null);
    }
    const now = performance.now();
    const isWritten = !playing || now - this.writtenMs > 200;
    if (isWritten) this.writtenMs = now;
    this.probe.update(frame, isWritten);
    this.bar.update(this.legend, this.label, this.note);
  }

  private change(more: Partial<TrackLook>): void {
    if (this.look) this.choose({ ...this.look, ...more });
  }

  private chooseRange(): void {
    const { value } = this.range;
    part("typed-range").hidden = value !== TYPED;
    if (value !== TYPED) return this.change({ range: value });
    const { range } = this.legend ?? {};
    if (!range) return;
    this.ends.forEach((end, i) => (end.value = String(Number(range[i].toPrecision(4)))));
    this.ends[0].focus();
    this.takeTyped();
  }

  private takeTyped(): void {
    const [low, high] = this.ends.map(({ value }) => value);
    const isRange = low !== "" && high !== "" && Number(low) < Number(high);
    this.ends[1].setCustomValidity(isRange ? "" : "The first number must be below the second.");
    if (isRange) this.change({ range: `${low}:${high}` });
    else this.ends[1].reportValidity();
  }

  private take(legend: ColorLegend | null): void {
    this.legend = legend;
    this.write();
    this.probe.take(legend, this.label);
    this.player.changed();
  }

  /** Has the controls say what is shown. */
  private write(): void {
    const { look, legend } = this;
    this.track.value = look?.track ?? "";
    part("track-options").hidden = look === null;
    if (!look || !legend) return;
    const { nColumns, kind } = this.reel.file.track(look.track).info;
    const range = look.range ?? (kind === "normal" ? "-1:1" : USUAL_RANGE);
    const columns = Array.from({ length: nColumns }, (_, c) => componentText(c, nColumns));
    const words = nColumns <= MOST_OF_LENGTH ? ["magnitude", ...columns] : columns;
    if (kind === "color") words.unshift("color");
    this.component.replaceChildren(...words.map((word) => new Option(wordOf(word), word)));
    this.component.value = componentText(legend.component, nColumns);
    part("component-row").hidden = nColumns === 1;
    this.note = (legend.range && RANGE_NOTES[range]) ?? "";
    part("range-row").hidden = legend.range === null;
    const isListed = [...this.range.options].some(({ value }) => value === range);
    this.range.value = isListed ? range : TYPED;
    part("typed-range").hidden = isListed || legend.range === null;
    if (!isListed) {
      this.ends.forEach((end, i) => (end.value = String(Number(legend.range?.[i].toPrecision(6)))));
    }
  }

  /** What is shown, in words. */
  private get label(): string {
    if (!this.legend) return "";
    const { name, component } = this.legend;
    const { nColumns } = this.reel.file.track(name).info;
    const isAlone = nColumns === 1 || component === "color";
    return isAlone ? name : `${name}, ${wordOf(componentText(component, nColumns))}`;
  }

}

function wordOf(component: string): string {
  if (component === "color") return "colours";
  return /^\d+$/.test(component) ? `column ${component}` : component;
}
