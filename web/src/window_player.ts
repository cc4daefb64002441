// `window.player`, by which tests, and scripts in the console, drive the page.

import type { Opening } from "./opening";
import type { Picture } from "./picture";
import type { Player, PlayerState } from "./player";
import type { TrackLook } from "./tracks/look";
import type { TrackPanel } from "./tracks/panel";

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
  /** Colours the mesh by a track. */
  setTrack(look: TrackLook | null): Promise<void>;
  /** Values of the plot at a vertex, face or corner; null where there is none. */
  probed(): readonly (number | null)[] | null;
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
    setTrack: (look: TrackLook | null) => tracks.show(look),
    probed: () => tracks.probe.values,
    state: () => player.state(),
  });
}
