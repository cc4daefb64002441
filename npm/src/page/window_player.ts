// `window.player`: the interface for tests and the browser console.

import type { Opening } from "./opening.js";
import type { Picture } from "./picture.js";
import type { Player } from "./player.js";
import type { TrackSettings } from "./facts.js";
import type { TrackPanel } from "./tracks/panel.js";

declare global {
  interface Window {
    player: ReturnType<typeof windowPlayer> & {
      /** Resolves when the initial frame is shown; rejects if the page cannot be opened. */
      ready: Promise<void>;
    };
  }
}

/** Return the interface of a page, without `ready`. */
export function windowPlayer(player: Player, picture: Picture, opening: Opening, tracks: TrackPanel) {
  return {
    /** Cancel automatic seeks of the page. */
    takeOver: () => opening.cancel(),
    seek: (frame: number) => player.seek(frame),
    play: () => void player.element.play(),
    pause: () => player.element.pause(),
    /** Read the drawn positions (V, 3) back from the GPU, in model units. */
    positions: () => player.positions(),
    /** Heat map values of all vertices; null without a heat map. */
    heatValues: () => picture.heatValues(),
    measureFps: (seconds: number) => player.measureFps(seconds),
    setHeat: (kind: string | null) => player.setHeat(kind),
    /** Color the mesh by a track. */
    setTrack: (look: TrackSettings | null) => tracks.show(look),
    probed: () => tracks.probe.values,
    state: () => player.state(),
  };
}
