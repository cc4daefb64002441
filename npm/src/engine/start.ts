// The engine at its end of a channel: answers questions in order.

import { Library } from "../core/library.js";
import type { TrackFields } from "../types.js";
import { Engine, type Read } from "./engine.js";
import {
  type Answers,
  type Calls,
  failureOf,
  type Port,
  type Question,
  type ToEngine,
} from "./messages.js";

interface Waiting {
  resolve(bytes: Uint8Array): void;
  reject(reason: unknown): void;
}

/** Answer what comes through a port, as long as it is open; load ahead after each answer. */
export function start(port: Port): void {
  const reads = new Map<number, Waiting>();
  const aborts = new Map<number, AbortController>();
  let nReads = 0;
  let library: Promise<Library>;
  let engine: Engine;
  let last: Promise<void> = Promise.resolve();

  const read: Read = (start, end, signal) =>
    new Promise((resolve, reject) => {
      signal.throwIfAborted();
      const id = nReads++;
      const drop = (): void => {
        if (!reads.delete(id)) return;
        port.postMessage({ drop: id }, []);
        reject(signal.reason);
      };
      signal.addEventListener("abort", drop, { once: true });
      const settled = (): void => signal.removeEventListener("abort", drop);
      reads.set(id, {
        resolve: (bytes) => (settled(), resolve(bytes)),
        reject: (reason) => (settled(), reject(reason)),
      });
      port.postMessage({ read: id, start, end }, []);
    });

  const answerTo = async ({ call, of }: Question, signal: AbortSignal) => {
    if (call === "open") {
      engine = await Engine.open(await library, read, of, signal);
      return { info: engine.info, surface: engine.surface };
    }
    if (call === "frame") return engine.frame(of.track, of.number, signal);
    if (call === "ranges") return engine.ranges();
    const { track, block, columns } = of as Calls["fields"];
    return engine.fields(track, block, columns, signal);
  };

  const work = async (question: Question, controller: AbortController): Promise<void> => {
    const { id } = question;
    try {
      controller.signal.throwIfAborted();
      const answer = await answerTo(question, controller.signal);
      port.postMessage({ id, answer }, buffersOf(answer));
    } catch (error) {
      port.postMessage({ id, failure: failureOf(error) }, []);
    } finally {
      aborts.delete(id);
    }
    void engine?.goAhead();
  };

  port.onmessage = ({ data }: MessageEvent<ToEngine>) => {
    if ("module" in data) {
      library = Library.start(data.module);
      library.catch(() => {}); // opening says it
    } else if ("cancel" in data) {
      aborts.get(data.cancel)?.abort();
    } else if ("read" in data) {
      const waiting = reads.get(data.read);
      reads.delete(data.read);
      if ("bytes" in data) waiting?.resolve(data.bytes);
      else waiting?.reject(Object.assign(new Error(data.failure.message), { name: data.failure.name }));
    } else {
      const controller = new AbortController();
      aborts.set(data.id, controller);
      last = last.then(() => work(data, controller));
    }
  };
}

/** What is handed over, and not copied. */
function buffersOf(answer: Answers[keyof Answers]): Transferable[] {
  if (ArrayBuffer.isView(answer)) return [answer.buffer];
  if (!("fields" in answer)) return [];
  const { fields, weights, correctionVertices, correctionOffsets } = answer as TrackFields;
  return [fields, weights, correctionVertices, correctionOffsets].map(({ buffer }) => buffer);
}
