// Exports of `meshreel`.

export * from "./errors.js";
export type { FileOptions } from "./file/engines.js";
export { type OpenOptions, ReelFile } from "./file/reel_file.js";
export { type CallOptions, type FieldsOptions, ReelTrack } from "./file/reel_track.js";
export { SegmentedReelFile } from "./file/segmented_reel_file.js";
export type { SourceInput, SourceOptions } from "./source/transport.js";
export type * from "./types.js";
