// The engine of further tracks at its end of a channel.

import type { Calls, Port } from "./messages.js";
import { serve } from "./serve.js";
import { TrackEngine } from "./track_engine.js";

/** Answers what comes through a port. */
export function start(port: Port): void {
  let engine: TrackEngine;
  serve(
    port,
    async ({ call, of }, core, read, signal) => {
      if (call === "openTracks") {
        engine = new TrackEngine(await core, read, of);
        return {};
      }
      if (call === "values") return engine.values(of.track, of.number, signal);
      const { track, block } = of as Calls["trackFields"];
      return engine.fields(track, block, signal);
    },
    () => void engine?.goAhead(),
  );
}
