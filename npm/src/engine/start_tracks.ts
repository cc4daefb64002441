// The engine of further tracks at its end of a channel.

import type { Calls, Port } from "./messages.js";
import { serve } from "./serve.js";
import { POSITIONS, TrackEngine } from "./track_engine.js";

/** Columns of positions. */
const COLUMNS = [0, 1, 2];

/** Answers what comes through a port. */
export function start(port: Port): void {
  let engine: TrackEngine;
  serve(
    port,
    async ({ call, of }, core, read, signal, readExact) => {
      if (call === "openTracks") {
        engine = new TrackEngine(await core, read, of, readExact);
        return {};
      }
      if (call === "frame") return engine.values(POSITIONS, of.number, signal);
      if (call === "fields") return engine.fields(POSITIONS, of.block, COLUMNS, signal);
      if (call === "values") return engine.values(of.track, of.number, signal);
      const { track, block, columns } = of as Calls["trackFields"];
      return engine.fields(track, block, columns, signal);
    },
    () => void engine?.goAhead(),
  );
}
