// Metadata from the server or the exported page, in addition to those of the file.

import type { OpenReel, OpenSegments } from "../index.js";

/** How a track colors the mesh, from the command line or the controls; null selects the default. */
export interface TrackSettings {
  readonly track: string;
  readonly component: string | null;
  /** "LOW:HIGH", each a number or a percentile. */
  readonly range: string | null;
  readonly colormap: "sequential" | "diverging" | null;
}

/** A heat map. */
export interface HeatInfo {
  kind: string;
  label: string;
  unit: string;
  maximum: number;
  range: number;
  /** The track, for errors of a track. */
  track?: string;
}

/** A curve of one value per frame. */
export interface PlotInfo {
  label: string;
  values: (number | null)[];
  /** Whether the values are those of a track, rather than errors. */
  isTrack?: boolean;
}

/** Until all frames are measured, ranges are those of the first frame, and plots and rows are empty. */
export interface Errors {
  heats: HeatInfo[];
  plots: PlotInfo[];
  rows: [string, string][];
  /** Frame with the largest error; null until all frames are measured. */
  worst_frame: number | null;
}

/** Metadata of the original. */
export interface OriginalInfo extends Errors {
  /** Diagonal of the bounding box of all its frames, in model units. */
  diagonal: number;
  /** Tracks that it shares with the file. */
  tracks: string[];
  /** Heat maps of tracks that are not exact. */
  track_heats: HeatInfo[];
}

/** Return all available heat maps. */
export function allHeats(original: OriginalInfo): HeatInfo[] {
  return [...original.heats, ...original.track_heats];
}

/** Whether a heat map shows errors of a track. */
export function isTrackHeat(kind: string | null): kind is string {
  return kind?.startsWith("track ") ?? false;
}

/** Errors, or the progress of measuring them. */
export interface ErrorProgress extends Errors {
  ready: boolean;
  /** Fraction of the measured frames. */
  share: number;
  /** Error message; empty if there was no error. */
  error: string;
}

/** A file embedded in the page, or its address. */
export type EmbeddedFile = { base64: string } | { url: string };

/** An image or video. */
export type EmbeddedTexture = EmbeddedFile & { mediaType: string };

/** Metadata of a file. */
export interface Facts {
  name: string;
  rows: [string, string][];
  budget: [string, number][];
  original: OriginalInfo | null;
  /** The track that initially colors the mesh, or null. */
  colored_by: TrackSettings | null;
  /** Image or video for the mesh, or null. */
  texture: EmbeddedTexture | null;
}

/** An open file and its metadata. */
export interface Reel extends Facts {
  /** The file with all its segments. */
  readonly segments: OpenSegments;
  /** The first segment; most files have only one. */
  readonly file: OpenReel;
}
