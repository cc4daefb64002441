// The engine at its end of a channel: answers one question after another.

import { Core } from "../core/core.js";
import type { BlockFields } from "../types.js";
import { Engine } from "./engine.js";
import { type Answers, failureOf, type Port, type Question, type ToEngine } from "./messages.js";

interface Waiting {
  resolve(bytes: Uint8Array): void;
  reject(reason: unknown): void;
}

/** Answers what comes through a port, in order, for as long as it is open. */
export function start(port: Port): void {
  const reads = new Map<number, Waiting>();
  const aborts = new Map<number, AbortController>();
  let nReads = 0;
  let core: Promise<Core>;
  let engine: Engine | null = null;
  let last: Promise<void> = Promise.resolve();

  const read = (from: number, to: number, signal: AbortSignal): Promise<Uint8Array> =>
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
      port.postMessage({ read: id, start: from, end: to }, []);
    });

  const answerTo = async (question: Question, signal: AbortSignal): Promise<Answers[keyof Answers]> => {
    signal.throwIfAborted();
    if (question.call === "open") {
      const { size, hasRanges } = question.of;
      engine = await Engine.open(core, read, size, hasRanges, signal);
      return { info: engine.info, surface: engine.surface };
    }
    return question.call === "frame"
      ? engine!.frame(question.of.number, signal)
      : engine!.fields(question.of.block, signal);
  };

  const work = async (question: Question, controller: AbortController): Promise<void> => {
    const { id } = question;
    try {
      const answer = await answerTo(question, controller.signal);
      port.postMessage({ id, answer }, buffersOf(answer));
    } catch (error) {
      port.postMessage({ id, failure: failureOf(error) }, []);
    } finally {
      aborts.delete(id);
    }
    if (question.call === "frame") void engine?.goAhead();
  };

  port.onmessage = ({ data }: MessageEvent<ToEngine>) => {
    if ("module" in data) {
      core = WebAssembly.instantiate(data.module).then((instance) => new Core(instance));
      core.catch(() => {}); // opening says it
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
  if ("info" in answer) return [];
  const { fields, weights, correctionVertices, correctionOffsets } = answer as BlockFields;
  return [fields, weights, correctionVertices, correctionOffsets].map(({ buffer }) => buffer);
}
