// How the page opens: playing; or, beside an original, at the frame of the largest error with the
// heat map of distances on.

import type { Player } from "./player";
import type { Reel } from "./facts";

export class Opening {
  private isOver = false;

  constructor(
    private readonly reel: Reel,
    private readonly player: Player,
  ) {
    const touches = ["pointerdown", "keydown"];
    for (const kind of touches) addEventListener(kind, () => this.end(), { capture: true });
  }

  /** Says that somebody has taken over: nothing moves by itself from now on. */
  end(): void {
    this.isOver = true;
  }

  async begin(): Promise<void> {
    const { original, file } = this.reel;
    if (original) {
      const [nearest] = original.heats;
      await this.player.setHeat(nearest.kind);
      await this.toLargestError();
    } else if (file.info.nFrames > 1 && !matchMedia("(prefers-reduced-motion: reduce)").matches) {
      this.player.play();
    }
  }

  /** Goes to the frame of the largest error once it is known, unless somebody has taken over. */
  async toLargestError(): Promise<void> {
    const worst = this.reel.original?.worst_frame ?? null;
    if (worst !== null && !this.isOver) await this.player.seek(worst);
  }
}
