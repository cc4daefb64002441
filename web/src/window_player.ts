// `window.player`, by which tests, and scripts in the console, drive the page.

import type { Opening } from "./opening";
import type { Picture } from "./picture";
import type { Player, PlayerState } from "./player";

export interface WindowPlayer {
  /** Resolves when the page has opened: the frame is shown that it opens at; rejects where it cannot be. */
  ready: Promise<void>;
  /** Keeps the page from going to another frame by itself. */
  takeOver(): void;
  seek(frame: number): Promise<void>;
  play(): void;
  pause(): void;
  /** Positions (V, 3) in model units as drawn, read back from the GPU. */
  positions(): Float32Array;
  /** Values by which each vertex is painted; null where there is no heat map. */
  heatValues(): Float32Array | null;
  measureFps(seconds: number): Promise<number>;
  setModes(nModes: number): void;
  setHeat(kind: string | null): Promise<void>;
  state(): PlayerState;
}

declare global {
  interface Window {
    player: WindowPlayer;
  }
}

export function exposeForTests(
  player: Player,
  picture: Picture,
  opening: Opening,
): void {
  Object.assign(window.player, {
    takeOver: () => opening.end(),
    seek: (frame: number) => player.seek(frame),
    play: () => player.play(),
    pause: () => player.pause(),
    positions: () => player.positions(),
    heatValues: () => picture.heatValues(),
    measureFps: (seconds: number) => player.measureFps(seconds),
    setModes: (nModes: number) => {
      player.setModes(nModes);
      player.drawNow();
    },
    setHeat: (kind: string | null) => player.setHeat(kind),
    state: () => player.state(),
  });
}
