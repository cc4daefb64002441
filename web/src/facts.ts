// What the server, or an exported page, says of a file beside the file itself.

import type { ReelFile } from "meshreel";

import type { TrackLook } from "./tracks/look";

export interface HeatInfo {
  kind: string;
  label: string;
  unit: string;
  maximum: number;
  range: number;
  /** Whose error it is, where it is of a track. */
  track?: string;
}

export interface PlotInfo {
  label: string;
  values: (number | null)[];
  /** Whether they are of a track, and no errors. */
  isOfTrack?: boolean;
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
  /** Tracks that it has as the file has them. */
  tracks: string[];
  /** Errors of those that are not exact in the file. */
  track_heats: HeatInfo[];
}

/** All heat maps that can be shown. */
export function heatsOf(original: OriginalInfo): HeatInfo[] {
  return [...original.heats, ...original.track_heats];
}

/** Whether a heat map is of a track. */
export function isOfTrack(kind: string | null): kind is string {
  return kind?.startsWith("track ") ?? false;
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
  /** The track that it opens with; null for none. */
  colored_by: TrackLook | null;
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
