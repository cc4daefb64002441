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

interface Waiting {
  readonly question: Question;
  resolve(answer: Answers[keyof Answers]): void;
  reject(reason: unknown): void;
}

/** A port to an engine, and how it ends. */
interface Line {
  readonly port: Port;
  readonly isWorker: boolean;
  close(): void;
}

export class RemoteEngine {
  private readonly waiting = new Map<number, Waiting>();
  private readonly reads = new Map<number, AbortController>();
  private line: Line;
  private nQuestions = 0;
  private hasAnswered = false;
  private closed: unknown = null;
  private module: WebAssembly.Module | null = null;

  /**
   * @param start - Begins it at its end of a channel; all that it needs is in the text of this.
   * @param source - Whose bytes it decodes.
   * @param inWorker - Whether it works in a worker; false: on this thread.
   */
  constructor(
    private readonly start: (port: Port) => void,
    private readonly source: Promise<ByteSource>,
    inWorker: boolean,
  ) {
    const failed = (reason: string): void => this.lose(reason);
    this.line = (inWorker && workerLine(start, failed)) || threadLine(start);
    this.listen();
  }

  /** Whether it works beside the page, and not on its thread. */
  get isInWorker(): boolean {
    return this.line.isWorker;
  }

  /** Hands it the library: it gets ready. */
  async begin(loading: Promise<WebAssembly.Module>): Promise<void> {
    this.module = await loading;
    if (!this.closed) this.say({ module: this.module });
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
        const question = { id, call, of } as Question;
        this.waiting.set(id, { question, resolve: resolve as Waiting["resolve"], reject });
        this.say(question);
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

  private listen(): void {
    this.line.port.onmessage = ({ data }: MessageEvent<FromEngine>) => this.hear(data);
  }

  /** Goes on without a worker that a content policy did not let begin; one that fell over is lost. */
  private lose(reason: string): void {
    if (this.closed) return;
    if (this.hasAnswered) {
      this.close(new errors.MeshReelError(`the worker that decodes has ended (${reason})`));
      return;
    }
    this.line.close();
    this.line = threadLine(this.start);
    this.listen();
    if (this.module) this.say({ module: this.module });
    for (const { question } of this.waiting.values()) this.say(question);
  }

  private say(message: ToEngine, transfer: Transferable[] = []): void {
    this.line.port.postMessage(message, transfer);
  }

  private hear(message: FromEngine): void {
    this.hasAnswered = true;
    if ("read" in message) {
      void this.read(message);
    } else if ("drop" in message) {
      this.reads.get(message.drop)?.abort();
    } else {
      const waiting = this.waiting.get(message.id);
      this.waiting.delete(message.id);
      if ("answer" in message) waiting?.resolve(message.answer);
      else waiting?.reject(errorOf(message.failure, Object.values(errors)));
    }
  }

  private async read({ read: id, start, end }: Extract<FromEngine, { start: number }>): Promise<void> {
    const controller = new AbortController();
    this.reads.set(id, controller);
    try {
      const bytes = await (await this.source).read(start, end, controller.signal);
      if (!this.closed) this.say({ read: id, bytes }, [bytes.buffer]);
    } catch (error) {
      if (!this.closed) this.say({ read: id, failure: failureOf(error) });
    } finally {
      this.reads.delete(id);
    }
  }
}

/** A worker whose script is the text of the engine; null where there can be none. */
function workerLine(
  start: (port: Port) => void,
  failed: (reason: string) => void,
): Line | null {
  if (typeof Worker === "undefined") return null;
  const script = new Blob([`(${start})(self)`], { type: "text/javascript" });
  const url = URL.createObjectURL(script);
  const close = (): void => {
    worker?.terminate();
    URL.revokeObjectURL(url);
  };
  let worker: Worker | null = null;
  try {
    worker = new Worker(url);
  } catch {
    close();
    return null; // as a content policy may want it
  }
  worker.onerror = (event) => {
    event.preventDefault();
    failed(event.message || "no reason is given");
  };
  return { port: worker, isWorker: true, close };
}

/** The engine on this thread. */
function threadLine(start: (port: Port) => void): Line {
  const { port1, port2 } = new MessageChannel();
  start(port2);
  const close = (): void => {
    port1.close();
    port2.close();
  };
  return { port: port1, isWorker: false, close };
}
