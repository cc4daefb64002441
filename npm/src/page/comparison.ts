// The panel section that compares with the original: heat maps, and errors of all frames, which the
// server may still be measuring.

import { loadErrorProgress } from "./data.js";
import { fillRows, inputById, byId } from "./page.js";
import type { LegendContent } from "../player/legend.js";
import { colorAt } from "../three/color/color_map.js";
import type { Opening } from "./opening.js";
import type { Player } from "./player.js";
import { Plot } from "./plots.js";
import { type Errors, allHeats, isTrackHeat, type OriginalInfo } from "./facts.js";
import { HEAT_COLORS } from "./shading/faces.js";

/** Update interval of displayed values during playback: faster updates are unreadable. */
const VALUE_INTERVAL_MS = 200;
const POLL_INTERVAL_MS = 700;

export class ComparisonPanel {
  private readonly heat = byId<HTMLSelectElement>("heat");
  private readonly perFrame = inputById("per-frame");
  private plots: Plot[] = [];
  private lastWriteMs = 0;

  constructor(
    private readonly player: Player,
    private readonly original: OriginalInfo,
    private readonly opening: Opening,
  ) {
    byId("compare").hidden = false;
    for (const { kind, label } of allHeats(original)) {
      const name = isTrackHeat(kind) ? label.replace(/, up to [^,]*$/, "") : label.split(/[,:]/)[0];
      this.heat.append(new Option(name, kind));
    }
    this.heat.addEventListener("change", () => this.chooseHeat());
    this.perFrame.addEventListener("change", () => {
      void this.player.setPerFrameRange(this.perFrame.checked).catch(this.player.onError);
    });
    this.render(original);
    if (original.plots.length === 0) void this.pollErrors().catch(player.onError);
  }

  /** The legend of the shown heat map, or null. */
  get legendContent(): LegendContent | null {
    const { heat: shown, hottest, perFrameRange } = this.player.state();
    const heat = allHeats(this.original).find(({ kind }) => kind === shown);
    if (!heat) return null;
    return {
      title: heat.label,
      unit: heat.unit,
      range: [0, hottest],
      isClipped: !perFrameRange && hottest < heat.maximum,
      note: this.rangeNote(perFrameRange),
      colorOf: (value) => colorAt(HEAT_COLORS, value / (hottest || 1)),
    };
  }

  /** Say which frames the colors span, if not all: the range changes with them. */
  private rangeNote(isPerFrame: boolean): string | undefined {
    if (isPerFrame) return "colors span this frame";
    return this.original.plots.length ? undefined : "colors span the first frame until all are measured";
  }

  /** Select the next heat map of the list, or none. */
  nextHeat(): void {
    this.heat.selectedIndex = (this.heat.selectedIndex + 1) % this.heat.options.length;
    this.chooseHeat();
  }

  update(): void {
    const { frame, playing, heat } = this.player.state();
    this.heat.value = heat ?? "";
    this.perFrame.disabled = heat === null;
    const now = performance.now();
    const writesValues = !playing || now - this.lastWriteMs > VALUE_INTERVAL_MS;
    if (writesValues) this.lastWriteMs = now;
    for (const plot of this.plots) plot.update(frame, writesValues);
  }

  private chooseHeat(): void {
    void this.player.setHeat(this.heat.value || null).catch(this.player.onError);
  }

  private async pollErrors(): Promise<void> {
    const note = byId("measuring");
    for (;;) {
      const measured = await loadErrorProgress();
      note.hidden = measured.ready;
      note.textContent = measured.error
        ? `The errors could not be measured: ${measured.error}`
        : `Measuring the errors of all frames: ${Math.floor(100 * measured.share)} %`;
      if (measured.error) return;
      if (measured.ready) return this.setErrors(measured);
      await new Promise((resolve) => setTimeout(resolve, POLL_INTERVAL_MS));
    }
  }

  private async setErrors({ heats, plots, rows, worst_frame }: Errors): Promise<void> {
    Object.assign(this.original, { heats, plots, rows, worst_frame });
    this.render(this.original);
    await this.player.setHeat(this.player.state().heat);
    await this.opening.seekLargestError();
  }

  private render({ plots, rows }: Errors): void {
    fillRows(byId("original-rows"), rows);
    const seek = (frame: number) => void this.player.seek(frame).catch(this.player.onError);
    this.plots = plots.map((info) => new Plot(info, seek));
    byId("plots").replaceChildren(...this.plots.map(({ figure }) => figure));
    this.update();
  }
}
