// The engine from outside: in a worker where there are workers, else on this thread.

import {
  type Answers,
  type Calls,
  errorOf,
  failureOf,
  type FromEngine,
  type Port,
  type Question,
  type ToEngine,
} from "../engine/messages.js";
import * as errors from "../errors.js";
import type { ByteSource } from "../types.js";
import { startEngine } from "./engine_function.js";

interface Waiting {
  resolve(answer: Answers[keyof Answers]): void;
  reject(reason: unknown): void;
}

/** A port to an engine, and how it ends. */
interface Line {
  readonly port: Port;
  close(): void;
}

export class RemoteEngine {
  private readonly waiting = new Map<number, Waiting>();
  private readonly reads = new Map<number, AbortController>();
  private readonly line: Line;
  private nQuestions = 0;
  private closed: unknown = null;

  /**
   * @param source - Whose bytes it decodes.
   * @param inWorker - Whether it works in a worker; false: on this thread.
   */
  constructor(
    private readonly source: ByteSource,
    inWorker: boolean,
  ) {
    this.line = (inWorker && workerLine((error) => this.close(error))) || threadLine();
    this.line.port.onmessage = ({ data }: MessageEvent<FromEngine>) => this.hear(data);
  }

  /** Asks, and gives the answer; a signal takes the question back. */
  async ask<Name extends keyof Calls>(
    call: Name,
    of: Calls[Name],
    signal?: AbortSignal,
  ): Promise<Answers[Name]> {
    signal?.throwIfAborted();
    if (this.closed) throw this.closed;
    const id = this.nQuestions++;
    const cancel = (): void => {
      this.say({ cancel: id });
      this.waiting.get(id)?.reject(signal!.reason);
      this.waiting.delete(id);
    };
    signal?.addEventListener("abort", cancel, { once: true });
    try {
      return await new Promise<Answers[Name]>((resolve, reject) => {
        this.waiting.set(id, { resolve: resolve as Waiting["resolve"], reject });
        this.say({ id, call, of } as Question);
      });
    } finally {
      signal?.removeEventListener("abort", cancel);
    }
  }

  /** Ends the engine; whoever waits gets the reason. */
  close(reason: unknown): void {
    if (this.closed) return;
    this.closed = reason;
    this.line.close();
    for (const { reject } of this.waiting.values()) reject(reason);
    for (const controller of this.reads.values()) controller.abort(reason);
    this.waiting.clear();
    this.reads.clear();
  }

  private say(message: ToEngine, transfer: Transferable[] = []): void {
    this.line.port.postMessage(message, transfer);
  }

  private hear(message: FromEngine): void {
    if ("read" in message) {
      void this.read(message.read, message.start, message.end);
    } else if ("drop" in message) {
      this.reads.get(message.drop)?.abort();
    } else {
      const waiting = this.waiting.get(message.id);
      this.waiting.delete(message.id);
      if ("answer" in message) waiting?.resolve(message.answer);
      else waiting?.reject(errorOf(message.failure, Object.values(errors)));
    }
  }

  private async read(id: number, start: number, end: number): Promise<void> {
    const controller = new AbortController();
    this.reads.set(id, controller);
    try {
      const bytes = await this.source.read(start, end, controller.signal);
      if (!this.closed) this.say({ read: id, bytes }, [bytes.buffer]);
    } catch (error) {
      if (!this.closed) this.say({ read: id, failure: failureOf(error) });
    } finally {
      this.reads.delete(id);
    }
  }
}

/** A worker whose script is the text of the engine; null where there can be none. */
function workerLine(failed: (error: Error) => void): Line | null {
  if (typeof Worker === "undefined") return null;
  const script = new Blob([`(${startEngine})(self)`], { type: "text/javascript" });
  const url = URL.createObjectURL(script);
  try {
    const worker = new Worker(url);
    worker.onerror = ({ message }) =>
      failed(
        new errors.MeshReelError(
          `the worker that decodes has ended (${message || "no reason is given"}); if the page has ` +
            "a content policy, allow worker-src blob:, or open with worker: false",
        ),
      );
    return { port: worker, close: () => worker.terminate() };
  } catch {
    return null; // the content policy forbids it
  } finally {
    // Browsers have taken up the script when the worker is made.
    setTimeout(() => URL.revokeObjectURL(url), 10_000);
  }
}

/** The engine on this thread. */
function threadLine(): Line {
  const { port1, port2 } = new MessageChannel();
  startEngine(port2);
  const close = (): void => {
    port1.close();
    port2.close();
  };
  return { port: port1, close };
}
