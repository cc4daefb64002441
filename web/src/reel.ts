// Facts of a file, as the server or an exported page gives them.

export interface BlockInfo {
  start: number;
  n_frames: number;
  n_modes: number;
  size_bytes: number;
}

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

export interface Reel {
  name: string;
  n_frames: number;
  n_verts: number;
  n_faces: number;
  fps: number;
  start_s: number;
  origin: [number, number, number];
  low: [number, number, number];
  high: [number, number, number];
  /** The outermost of all positions of all frames, from the origin. */
  swept: [number, number, number][];
  diagonal: number;
  up: "y" | "z";
  is_whole: boolean;
  blocks: BlockInfo[];
  rows: [string, string][];
  budget: [string, number][];
  original: OriginalInfo | null;
}

/** Frames per second to play at; 24 where the file does not say. */
export function playingFps(reel: Reel): number {
  return reel.fps > 0 ? reel.fps : 24;
}

/** Time of a frame in seconds, as the file counts it. */
export function secondsOf(reel: Reel, frame: number): number {
  return reel.start_s + frame / playingFps(reel);
}

/** Number of the block that holds a frame; -1 where none does. */
export function blockOf(reel: Reel, frame: number): number {
  return reel.blocks.findLastIndex((block) => block.start <= frame);
}

/** The most modes that any block has. */
export function mostModes(reel: Reel): number {
  return reel.blocks.reduce((most, block) => Math.max(most, block.n_modes), 0);
}
