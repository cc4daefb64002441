// What the server, or an exported page, says of a file beside the file itself.

import type { ReelFile } from "meshreel";

export interface HeatInfo {
  kind: string;
  label: string;
  unit: string;
  maximum: number;
  range: number;
}

export interface PlotInfo {
  label: string;
  values: (number | null)[];
}

/** Ranges are of the first frame, and plots and rows are empty, until all frames are measured. */
export interface Errors {
  heats: HeatInfo[];
  plots: PlotInfo[];
  rows: [string, string][];
  /** That of the largest error; null until all frames are measured. */
  worst_frame: number | null;
}

export interface OriginalInfo extends Errors {
  name: string;
  /** Of the box of all its frames, in model units. */
  diagonal: number;
}

export interface Measured extends Errors {
  ready: boolean;
  /** Of the frames that are measured. */
  share: number;
  /** Why not all can be measured; empty if nothing went wrong. */
  error: string;
}

export interface Facts {
  name: string;
  /** Of the box of all frames, in model units. */
  low: [number, number, number];
  high: [number, number, number];
  /** The outermost of all positions of all frames, from the centre of the file. */
  swept: [number, number, number][];
  up: "y" | "z";
  is_whole: boolean;
  /** Of each block. */
  n_modes: number[];
  rows: [string, string][];
  budget: [string, number][];
  original: OriginalInfo | null;
}

/** A file that is open, and what is said of it. */
export interface Reel extends Facts {
  readonly file: ReelFile;
}

/** Frames per second to play at; 24 where the file does not say. */
export function playingFps({ file }: Reel): number {
  return file.info.fps > 0 ? file.info.fps : 24;
}

/** Time of a frame in seconds, as the file counts it. */
export function secondsOf(reel: Reel, frame: number): number {
  return reel.file.info.startS + frame / playingFps(reel);
}

/** The most modes that any block has. */
export function mostModes(reel: Reel): number {
  return Math.max(0, ...reel.n_modes);
}
