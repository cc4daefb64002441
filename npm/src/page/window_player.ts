// `window.player`: the interface for tests and the browser console.

import type { Opening } from "./opening.js";
import type { Picture } from "./picture.js";
import type { Player, PlayerState } from "./player.js";
import type { TrackSettings } from "./tracks/settings.js";
import type { TrackPanel } from "./tracks/panel.js";

export interface WindowPlayer {
  /** Resolves when the initial frame is shown; rejects if the page cannot be opened. */
  ready: Promise<void>;
  /** Cancel automatic seeks of the page. */
  takeOver(): void;
  seek(frame: number): Promise<void>;
  play(): void;
  pause(): void;
  /** Read the drawn positions (V, 3) back from the GPU, in model units. */
  positions(): Float32Array;
  /** Heat map values of all vertices; null without a heat map. */
  heatValues(): Float32Array | null;
  measureFps(seconds: number): Promise<number>;
  setModes(nModes: number): void;
  setHeat(kind: string | null): Promise<void>;
  /** Color the mesh by a track. */
  setTrack(look: TrackSettings | null): Promise<void>;
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
  tracks: TrackPanel,
): void {
  Object.assign(window.player, {
    takeOver: () => opening.cancel(),
    seek: (frame: number) => player.seek(frame),
    play: () => void player.element.play(),
    pause: () => player.element.pause(),
    positions: () => player.positions(),
    heatValues: () => picture.heatValues(),
    measureFps: (seconds: number) => player.measureFps(seconds),
    setModes: (nModes: number) => {
      player.setModes(nModes);
      player.parts.view.drawNow();
    },
    setHeat: (kind: string | null) => player.setHeat(kind),
    setTrack: (look: TrackSettings | null) => tracks.show(look),
    state: () => player.state(),
  });
}
