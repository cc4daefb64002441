// Client of an engine that runs in a worker, or on this thread if workers are unavailable.

import { loadModule } from "../core/module.js";
import {
  type Results,
  type Calls,
  type Failure,
  toFailure,
  type FromEngine,
  type Port,
  type CallMessage,
  type ToEngine,
} from "../engine/messages.js";
import * as errors from "../errors.js";
import type { ByteSource } from "../types.js";
import { startEngine } from "./engine_script.js";

interface PendingCall {
  readonly message: CallMessage;
  resolve(result: Results[keyof Results]): void;
  reject(reason: unknown): void;
}

/** A port to an engine. */
interface Connection {
  readonly port: Port;
  readonly isWorker: boolean;
  close(): void;
}

/** Calls an engine and serves its read requests. */
export class RemoteEngine {
  private readonly pending = new Map<number, PendingCall>();
  private readonly reads = new Map<number, AbortController>();
  private connection: Connection;
  private nCalls = 0;
  private hasResponded = false;
  private closed: unknown = null;
  private module: WebAssembly.Module | null = null;
  private fullModule: Promise<void> | null = null;

  /**
   * @param source - The bytes to decode.
   * @param inWorker - Whether to use a worker; false: this thread.
   */
  constructor(
    private readonly source: Promise<ByteSource>,
    inWorker: boolean,
  ) {
    const onFailure = (reason: string): void => this.recover(reason);
    this.connection = (inWorker && connectWorker(onFailure)) || connectThread();
    this.attach();
  }

  /** Whether the engine runs in a worker. */
  get isInWorker(): boolean {
    return this.connection.isWorker;
  }

  /** Whether the engine has the full module. */
  get isFull(): boolean {
    return this.fullModule !== null;
  }

  /** Send the compiled library to the engine. */
  async sendModule(isFull: boolean): Promise<void> {
    this.module = await loadModule(isFull);
    if (!this.closed) this.post({ module: this.module });
  }

  /** Call the engine and return the result; the signal cancels the call. Loads the full module if needed. */
  async call<Name extends keyof Calls>(
    call: Name,
    args: Calls[Name],
    signal?: AbortSignal,
  ): Promise<Results[Name]> {
    try {
      return await this.callOnce(call, args, signal);
    } catch (error) {
      if ((error as Error).name !== "IncompleteModule") throw error;
    }
    this.fullModule ??= this.sendModule(true).catch((error: unknown) => {
      this.fullModule = null; // the next call tries again
      throw error;
    });
    await this.fullModule;
    return this.callOnce(call, args, signal);
  }

  private async callOnce<Name extends keyof Calls>(
    call: Name,
    args: Calls[Name],
    signal?: AbortSignal,
  ): Promise<Results[Name]> {
    signal?.throwIfAborted();
    if (this.closed) throw this.closed;
    const id = this.nCalls++;
    const cancel = (): void => {
      this.post({ cancel: id });
      this.pending.get(id)?.reject(signal!.reason);
      this.pending.delete(id);
    };
    signal?.addEventListener("abort", cancel, { once: true });
    try {
      return await new Promise<Results[Name]>((resolve, reject) => {
        const message = { id, call, args } as CallMessage;
        this.pending.set(id, { message, resolve: resolve as PendingCall["resolve"], reject });
        this.post(message);
      });
    } finally {
      signal?.removeEventListener("abort", cancel);
    }
  }

  /** Stop the engine; pending calls throw the reason. */
  close(reason: unknown): void {
    if (this.closed) return;
    this.closed = reason;
    this.connection.close();
    for (const { reject } of this.pending.values()) reject(reason);
    for (const controller of this.reads.values()) controller.abort(reason);
    this.pending.clear();
    this.reads.clear();
  }

  private attach(): void {
    this.connection.port.onmessage = ({ data }: MessageEvent<FromEngine>) => this.receive(data);
  }

  /**
   * Handle an error of the worker: if it never responded, as when a content policy blocks it, move to
   * this thread; otherwise fail.
   */
  private recover(reason: string): void {
    if (this.closed) return;
    if (this.hasResponded) {
      this.close(new errors.MeshReelError(`the decoding worker stopped (${reason})`));
      return;
    }
    this.connection.close();
    this.connection = connectThread();
    this.attach();
    if (this.module) this.post({ module: this.module });
    for (const { message } of this.pending.values()) this.post(message);
  }

  private post(message: ToEngine, transfer: Transferable[] = []): void {
    this.connection.port.postMessage(message, transfer);
  }

  private receive(message: FromEngine): void {
    this.hasResponded = true;
    if ("read" in message) {
      void this.read(message);
    } else if ("cancelRead" in message) {
      this.reads.get(message.cancelRead)?.abort();
    } else {
      const pending = this.pending.get(message.id);
      this.pending.delete(message.id);
      if ("result" in message) pending?.resolve(message.result);
      else pending?.reject(toError(message.failure));
    }
  }

  private async read({ read: id, start, end }: Extract<FromEngine, { start: number }>): Promise<void> {
    const controller = new AbortController();
    this.reads.set(id, controller);
    try {
      const bytes = await (await this.source).read(start, end, controller.signal);
      if (!this.closed) this.post({ read: id, bytes }, [bytes.buffer]);
    } catch (error) {
      if (!this.closed) this.post({ read: id, failure: toFailure(error) });
    } finally {
      this.reads.delete(id);
    }
  }
}

/** Create the error of a failure; of another name than those of our classes, a DOMException. */
function toError({ name, message }: Failure): Error {
  const ErrorClass = (errors as Partial<Record<string, typeof errors.MeshReelError>>)[name];
  return ErrorClass ? new ErrorClass(message) : new DOMException(message, name);
}

/** Start a worker whose script is the source text of the engine; null if workers are unavailable. */
function connectWorker(onFailure: (reason: string) => void): Connection | null {
  if (typeof Worker === "undefined") return null;
  const script = new Blob([`(${startEngine})(self)`], { type: "text/javascript" });
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
    return null; // blocked by a content policy
  }
  worker.onerror = (event) => {
    event.preventDefault();
    onFailure(event.message || "unknown reason");
  };
  return { port: worker, isWorker: true, close };
}

/** Run the engine on this thread. */
function connectThread(): Connection {
  const { port1, port2 } = new MessageChannel();
  startEngine(port2);
  const close = (): void => {
    port1.close();
    port2.close();
  };
  return { port: port1, isWorker: false, close };
}
