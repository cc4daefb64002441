// The part of the panel that compares with the original: heat maps, and errors of all frames, which
// the server still measures when the page is opened.

import { loadMeasured } from "./data";
import { fillRows, input, part } from "./page";
import { shortNumber } from "./heat/map";
import type { Opening } from "./opening";
import type { Player } from "./player";
import { Plot } from "./plots";
import { type Errors, type HeatInfo, heatsOf, isOfTrack, type OriginalInfo } from "./facts";

/** While playing, values are written this seldom: faster, nobody reads them. */
const BETWEEN_VALUES_MS = 200;
const BETWEEN_QUESTIONS_MS = 700;

export class ComparisonPanel {
  private readonly heat = part<HTMLSelectElement>("heat");
  private readonly perFrame = input("per-frame");
  private plots: Plot[] = [];
  private writtenMs = 0;

  constructor(
    private readonly player: Player,
    private readonly original: OriginalInfo,
    private readonly opening: Opening,
  ) {
    part("compare").hidden = false;
    for (const { kind, label } of heatsOf(original)) {
      const name = isOfTrack(kind) ? label.replace(/, up to [^,]*$/, "") : label.split(/[,:]/)[0];
      this.heat.append(new Option(name, kind));
    }
    this.heat.addEventListener("change", () => this.chooseHeat());
    this.perFrame.addEventListener("change", () => {
      void this.player.setPerFrameRange(this.perFrame.checked).catch(this.player.failed);
    });
    this.show(original);
    if (original.plots.length === 0) void this.follow().catch(player.failed);
  }

  /** The heat map that is chosen. */
  get heatInfo(): HeatInfo | null {
    const { heat } = this.player.state();
    return heatsOf(this.original).find(({ kind }) => kind === heat) ?? null;
  }

  /** Takes the next heat map of the list, or none. */
  nextHeat(): void {
    this.heat.selectedIndex = (this.heat.selectedIndex + 1) % this.heat.options.length;
    this.chooseHeat();
  }

  update(): void {
    const { frame, playing, heat, isFew } = this.player.state();
    this.heat.value = heat ?? "";
    this.perFrame.disabled = heat === null;
    const now = performance.now();
    const isWritten = !playing || now - this.writtenMs > BETWEEN_VALUES_MS;
    if (isWritten) this.writtenMs = now;
    for (const plot of this.plots) plot.update(frame, isWritten);
    this.markFew(isFew);
    if (isWritten) this.writeErrorsOfFew();
  }

  /** Greys out the errors of all modes while fewer are shown, and says so. */
  private markFew(isFew: boolean): void {
    part("few").hidden = !isFew;
    for (const id of ["plots", "original-rows"]) part(id).classList.toggle("of-all", isFew);
  }

  private writeErrorsOfFew(): void {
    const { modes, frameErrors } = this.player.state();
    if (!frameErrors) return;
    const { frame } = frameErrors;
    const percent = (value: number) => `${shortNumber(Number(value.toPrecision(3)))} %`;
    part("few-title").textContent = `Frame ${frame} with ${modes === 1 ? "1 mode" : `${modes} modes`}`;
    fillRows(part("few-rows"), [
      ["largest error", `${percent(frameErrors.largest)} of the diagonal`],
      ["RMS error", `${percent(frameErrors.rms)} of the diagonal`],
    ]);
  }

  private chooseHeat(): void {
    void this.player.setHeat(this.heat.value || null).catch(this.player.failed);
  }

  private async follow(): Promise<void> {
    const note = part("measuring");
    for (;;) {
      const measured = await loadMeasured();
      note.hidden = measured.ready;
      note.textContent = measured.error
        ? `The errors could not be measured: ${measured.error}`
        : `Measuring the errors of all frames: ${Math.floor(100 * measured.share)} %`;
      if (measured.error) return;
      if (measured.ready) return this.take(measured);
      await new Promise((resolve) => setTimeout(resolve, BETWEEN_QUESTIONS_MS));
    }
  }

  private async take({ heats, plots, rows, worst_frame }: Errors): Promise<void> {
    Object.assign(this.original, { heats, plots, rows, worst_frame });
    this.show(this.original);
    await this.player.setHeat(this.player.state().heat);
    await this.opening.toLargestError();
  }

  private show({ plots, rows }: Errors): void {
    fillRows(part("original-rows"), rows);
    const seek = (frame: number) => void this.player.seek(frame).catch(this.player.failed);
    this.plots = plots.map((info) => new Plot(info, seek));
    part("plots").replaceChildren(...this.plots.map(({ figure }) => figure));
    this.update();
  }
}
