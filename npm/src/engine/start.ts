// The engine of the positions at its end of a channel.

import { Engine } from "./engine.js";
import type { Port } from "./messages.js";
import { serve } from "./serve.js";

/** Answers what comes through a port. */
export function start(port: Port): void {
  let engine: Engine;
  serve(
    port,
    async ({ call, of }, core, read, signal) => {
      if (call === "open") {
        engine = await Engine.open(core, read, of.size, of.hasRanges, signal, of.memory);
        return { info: engine.info, surface: engine.surface };
      }
      if (call === "frame") return engine.frame(of.number, signal);
      if (call === "fields") return engine.fields(of.block, signal);
      return engine.ofTracks();
    },
    () => void engine?.goAhead(),
  );
}
