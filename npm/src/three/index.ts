// `meshreel/three`: files in scenes of three.js.

export type { Loop } from "./clock";
export type { PlaybackEvents } from "./playback";
export { type OpenFunction, ReelLoader, type ReelLoaderOptions } from "./reel_loader";
export { ReelMesh, type ReelMeshEventMap, type ReelMeshOptions } from "./reel_mesh";
