// What a download needs to know of who sends it.

import { SourceError } from "../errors.js";

/** The answer to a question for the bytes from some position on. */
export interface Answer {
  /** Position of the first byte of the body; not behind what was asked for. */
  readonly start: number;
  /** Position behind its last byte; null where only the end of the body tells. */
  readonly end: number | null;
  /** Whether the body cannot hold more than that. Where it could, none counts before its end. */
  readonly isFramed: boolean;
  readonly body: ReadableStream<Uint8Array> | null;
}

/** Gives bytes from a position on, as often as it is asked. */
export interface Server {
  /** For messages: the address. */
  readonly name: string;
  /** Bytes of the file; null as long as that is unknown. */
  readonly size: number | null;
  readonly hasRanges: boolean;
  /**
   * Asks for the bytes `start` to `end - 1`.
   *
   * @throws PassingError where it may help to ask again, otherwise SourceError.
   */
  ask(start: number, end: number, signal: AbortSignal): Promise<Answer>;
}

/** A failure that may pass: of the network, or of a server that has trouble. */
export class PassingError extends SourceError {}

/** How long to try. */
export interface Patience {
  /** How often to ask again where nothing new comes. */
  readonly retries: number;
  /** How long to wait for a byte, in milliseconds. */
  readonly stallMs: number;
}

/** The words of a failure of the network; Node has them in the cause. */
export function reasonOf(error: unknown): string {
  const { message, cause } = error as { message?: string; cause?: { message?: string } };
  return cause?.message || message || String(error);
}

export function changedError(name: string): SourceError {
  return new SourceError(`${name} has changed since it was opened; open it again`);
}
