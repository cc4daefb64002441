// What a reel and its engines say to each other. They run in workers, or beside the reel.

import type { ReelInfo, Surface, TrackFields, TrackValues } from "../types.js";
import type { Opening } from "./engine.js";
import type { Range } from "./ranges.js";

/** An error on its way: what is thrown on the other side has this name and these words. */
export interface Failure {
  readonly name: string;
  readonly message: string;
}

/**
 * What engines are asked, by the name of the call, and what they answer. Track 0 is the positions;
 * `ranges` gives what was read to open the file, for another engine.
 */
export interface Calls {
  open: Opening;
  ranges: object;
  frame: { track: number; number: number };
  fields: { track: number; block: number; columns: readonly number[] };
}
export interface Answers {
  open: { info: ReelInfo; surface: Surface };
  ranges: readonly Range[];
  frame: TrackValues;
  fields: TrackFields;
}

export type Question = {
  [Name in keyof Calls]: { readonly id: number; readonly call: Name; readonly of: Calls[Name] };
}[keyof Calls];

export type ToEngine =
  /** The library, which comes before all questions. */
  | { readonly module: WebAssembly.Module }
  | Question
  /** Nobody waits for the answer any more. */
  | { readonly cancel: number }
  /** Bytes that it asked for. */
  | { readonly read: number; readonly bytes: Uint8Array }
  | { readonly read: number; readonly failure: Failure };

export type FromEngine =
  | { readonly id: number; readonly answer: Answers[keyof Answers] }
  | { readonly id: number; readonly failure: Failure }
  /** Bytes of the file that it asks for. */
  | { readonly read: number; readonly start: number; readonly end: number }
  /** The bytes of this read are no longer needed. */
  | { readonly drop: number };

/** The end of a channel: of a worker, from inside or outside, or a port. */
export interface Port {
  onmessage: ((event: MessageEvent) => void) | null;
  postMessage(message: unknown, transfer: Transferable[]): void;
}

const ABORTED = "AbortError";

/** What is said of an error. */
export function failureOf(error: unknown): Failure {
  if (!(error instanceof Error || error instanceof DOMException)) {
    return { name: "Error", message: String(error) };
  }
  return { name: error.name, message: error.message };
}

/** The error that a failure stands for, of the class of `classes` that has its name. */
export function errorOf(
  { name, message }: Failure,
  classes: readonly (new (message: string) => Error)[],
): Error {
  const own = classes.map((made) => new made(message)).find((error) => error.name === name);
  if (own) return own;
  if (name === ABORTED) return new DOMException(message, name) as unknown as Error;
  return Object.assign(new Error(message), { name });
}
