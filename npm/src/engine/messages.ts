// Messages between a `ReelFile` and its engines, which run in workers or on the same thread.

import type {
  CellPolygons,
  CutPlane,
  FileInfo,
  ReelInfo,
  SegmentInfo,
  Surface,
  TrackFields,
  TrackValues,
} from "../types.js";
import type { Range } from "./ranges.js";
import type { OpenParameters } from "./segments_engine.js";

/** An error in a message: the receiver throws an error of this name and message. */
export interface Failure {
  readonly name: string;
  readonly message: string;
}

/**
 * Arguments of calls of an engine, by name. `open` must be the first call; further ones open other
 * segments. The segment may be null if the file has only one. Track 0 is the positions. `ranges`
 * returns the bytes that were read to open the file, for the engine of tracks; `segments` describes all
 * segments, which may be very many.
 */
export interface Calls {
  open: OpenParameters & { segment: number | null; ranges?: readonly Range[] };
  ranges: object;
  segments: object;
  image: { segment: number | null; image: number };
  cut: { segment: number | null; plane: CutPlane };
  frame: { segment: number | null; track: number; frame: number };
  fields: { segment: number | null; track: number; block: number; columns: readonly number[] };
}

/** Results of the calls. */
export interface Results {
  open: { file: FileInfo; info: ReelInfo; surface: Surface };
  ranges: readonly Range[];
  segments: readonly SegmentInfo[];
  image: Uint8Array;
  cut: CellPolygons;
  frame: TrackValues;
  fields: TrackFields;
}

/** A call; its response has the same id. */
export type CallMessage = {
  [Name in keyof Calls]: { readonly id: number; readonly call: Name; readonly args: Calls[Name] };
}[keyof Calls];

/** Messages to an engine. */
export type ToEngine =
  /** The compiled library; sent before all calls, and again when a file needs the full one. */
  | { readonly module: WebAssembly.Module }
  | CallMessage
  /** Cancels the call of this id. */
  | { readonly cancel: number }
  /** Response to a read request. */
  | { readonly read: number; readonly bytes: Uint8Array }
  | { readonly read: number; readonly failure: Failure };

/** Messages from an engine. */
export type FromEngine =
  | { readonly id: number; readonly result: Results[keyof Results] }
  | { readonly id: number; readonly failure: Failure }
  /** Requests bytes of the file. */
  | { readonly read: number; readonly start: number; readonly end: number }
  /** Cancels the read request of this id. */
  | { readonly cancelRead: number };

/** One end of a channel: a worker, its global scope, or a `MessagePort`. */
export interface Port {
  onmessage: ((event: MessageEvent) => void) | null;
  postMessage(message: unknown, transfer: Transferable[]): void;
}

/** Convert an error to a message. */
export function toFailure(error: unknown): Failure {
  const { name = "Error", message = String(error) } = (error ?? {}) as Partial<Failure>;
  return { name, message };
}
