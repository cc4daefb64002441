// An engine at its end of a channel: answers one question after another.

import { Core } from "../core/core.js";
import type { BlockFields } from "../types.js";
import { type Answers, failureOf, type Port, type Question, type ToEngine, type Wanted } from "./messages.js";
import type { Read } from "./opening.js";

/**
 * Answers a question.
 *
 * @param readExact - Gives the bytes of the module that decodes exact values.
 */
export type AnswerTo = (
  question: Question,
  core: Promise<Core>,
  read: Read,
  signal: AbortSignal,
  readExact: () => Promise<Uint8Array>,
) => Promise<Answers[keyof Answers]>;

interface Waiting {
  resolve(bytes: Uint8Array): void;
  reject(reason: unknown): void;
}

/**
 * Answers what comes through a port, in order, for as long as it is open.
 *
 * @param goAhead - Is called behind each answer: a time to decode what comes next.
 */
export function serve(port: Port, answerTo: AnswerTo, goAhead: () => void): void {
  const reads = new Map<number, Waiting>();
  const aborts = new Map<number, AbortController>();
  let nReads = 0;
  let core: Promise<Core>;
  let last: Promise<void> = Promise.resolve();

  const ask = (what: Wanted, signal: AbortSignal): Promise<Uint8Array> =>
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
      port.postMessage({ read: id, ...what }, []);
    });

  const work = async (question: Question, controller: AbortController): Promise<void> => {
    const { id } = question;
    try {
      const { signal } = controller;
      signal.throwIfAborted();
      const read: Read = (start, end, ending) => ask({ start, end }, ending);
      const answer = await answerTo(question, core, read, signal, () =>
        ask({ exact: true }, signal),
      );
      port.postMessage({ id, answer }, buffersOf(answer));
    } catch (error) {
      port.postMessage({ id, failure: failureOf(error) }, []);
    } finally {
      aborts.delete(id);
    }
    goAhead();
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
  if (!("fields" in answer)) return [];
  const { fields, weights, correctionVertices, correctionOffsets } = answer as BlockFields;
  return [fields, weights, correctionVertices, correctionOffsets].map(({ buffer }) => buffer);
}
