// Runs an engine at one end of a channel.

import { Library } from "../core/library.js";
import type { TrackFields } from "../types.js";
import type { Engine, Read } from "./engine.js";
import {
  type Results,
  type Calls,
  toFailure,
  type Port,
  type CallMessage,
  type ToEngine,
} from "./messages.js";
import { Ranges } from "./ranges.js";
import { SegmentsEngine } from "./segments_engine.js";

interface PendingRead {
  resolve(bytes: Uint8Array): void;
  reject(reason: unknown): void;
}

/** Serve calls that arrive at a port, in order, and prefetch after each of them. */
export function start(port: Port): void {
  const reads = new Map<number, PendingRead>();
  const aborts = new Map<number, AbortController>();
  let nReads = 0;
  let library: Promise<Library>;
  let file: SegmentsEngine | null = null;
  let parameters: Calls["open"] | null = null;
  let opening = new Ranges(); // bytes of a file that is not open yet
  let lastEngine: Engine | null = null;
  let queue: Promise<void> = Promise.resolve();

  const read: Read = (start, end, signal) =>
    new Promise((resolve, reject) => {
      signal.throwIfAborted();
      const id = nReads++;
      const cancel = (): void => {
        if (!reads.delete(id)) return;
        port.postMessage({ cancelRead: id }, []);
        reject(signal.reason);
      };
      signal.addEventListener("abort", cancel, { once: true });
      const removeListener = (): void => signal.removeEventListener("abort", cancel);
      reads.set(id, {
        resolve: (bytes) => (removeListener(), resolve(bytes)),
        reject: (reason) => (removeListener(), reject(reason)),
      });
      port.postMessage({ read: id, start, end }, []);
    });

  const execute = async ({ call, args }: CallMessage, signal: AbortSignal) => {
    if (call === "ranges") return file ? file.ranges() : opening.list();
    if (call === "open" && !parameters) {
      parameters = args;
      opening = new Ranges(args.ranges);
    }
    if (!file) {
      file = await SegmentsEngine.open(await library, opening, read, parameters!, signal);
      opening = new Ranges();
    }
    const opened = file;
    if (call === "segments") return opened.segments;
    const engine = (lastEngine = await opened.segment((args as Calls["open"]).segment, signal));
    if (call === "open") {
      const { info, surface } = engine;
      return { file: opened.info, info, surface };
    }
    if (call === "image") return engine.image(args.image, signal);
    if (call === "cut") return engine.cut(args.plane, signal);
    if (call === "frame") return engine.frame(args.track, args.frame, signal);
    const { track, block, columns } = args as Calls["fields"];
    return engine.fields(track, block, columns, signal);
  };

  const respond = async (message: CallMessage, controller: AbortController): Promise<void> => {
    const { id } = message;
    try {
      controller.signal.throwIfAborted();
      const result = await execute(message, controller.signal);
      port.postMessage({ id, result }, transferablesOf(result));
    } catch (error) {
      port.postMessage({ id, failure: toFailure(error) }, []);
    } finally {
      aborts.delete(id);
    }
    void lastEngine?.prefetch();
  };

  port.onmessage = ({ data }: MessageEvent<ToEngine>) => {
    if ("module" in data) {
      // The next call opens the file again, with this module.
      opening = file ? new Ranges(file.ranges()) : opening;
      file = lastEngine = null;
      library = Library.instantiate(data.module);
      library.catch(() => {}); // reported when the file is opened
    } else if ("cancel" in data) {
      aborts.get(data.cancel)?.abort();
    } else if ("read" in data) {
      const pending = reads.get(data.read);
      reads.delete(data.read);
      if ("bytes" in data) pending?.resolve(data.bytes);
      else pending?.reject(data.failure);
    } else {
      const controller = new AbortController();
      aborts.set(data.id, controller);
      const responded = queue.then(() => respond(data, controller));
      if (data.call !== "image") queue = responded; // frames do not wait for images
    }
  };
}

/** Buffers of a result that are transferred instead of copied. */
function transferablesOf(result: Results[keyof Results]): Transferable[] {
  if (ArrayBuffer.isView(result)) return [result.buffer];
  if (!("fields" in result)) return [];
  const { fields, weights, correctionVertices, correctionOffsets } = result as TrackFields;
  return [fields, weights, correctionVertices, correctionOffsets].map(({ buffer }) => buffer);
}
