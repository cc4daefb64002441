// The initial state of the page: playing, or, with an original, at the frame of the largest error with
// the heat map of distances.

import type { Player } from "./player.js";
import type { Reel } from "./facts.js";

export class Opening {
  private isCanceled = false;

  constructor(
    private readonly reel: Reel,
    private readonly player: Player,
  ) {
    const touches = ["pointerdown", "keydown"];
    for (const kind of touches) addEventListener(kind, () => this.cancel(), { capture: true });
  }

  /** Cancel automatic seeks, since the user has started to interact. */
  cancel(): void {
    this.isCanceled = true;
  }

  async begin(): Promise<void> {
    const { original, segments } = this.reel;
    if (original) {
      const [distance] = original.heats;
      await this.player.setHeat(distance.kind);
      await this.seekLargestError();
    } else if (segments.info.nFrames > 1 && !matchMedia("(prefers-reduced-motion: reduce)").matches) {
      this.player.toggle();
    }
  }

  /** Seek to the frame of the largest error once it is known, unless canceled. */
  async seekLargestError(): Promise<void> {
    const worst = this.reel.original?.worst_frame ?? null;
    if (worst !== null && !this.isCanceled) await this.player.seek(worst);
  }
}
