// The engine at its end of a channel.

import { Engine } from "./engine.js";
import type { Calls, Port } from "./messages.js";
import { serve } from "./serve.js";

/** Answers what comes through a port. */
export function start(port: Port): void {
  let engine: Engine;
  serve(
    port,
    async ({ call, of }, library, read, signal) => {
      if (call === "open") {
        engine = await Engine.open(await library, read, of, signal);
        return { info: engine.info, surface: engine.surface };
      }
      if (call === "frame") return engine.frame(of.track, of.number, signal);
      if (call === "ranges") return engine.ranges();
      const { track, block, columns } = of as Calls["fields"];
      return engine.fields(track, block, columns, signal);
    },
    () => void engine?.goAhead(),
  );
}
