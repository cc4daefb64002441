// `meshreel/three`: files in scenes of three.js.

export type { Loop } from "./clock.js";
export type { PlaybackEvents } from "./playback.js";
export { ReelLoader, type ReelLoaderOptions } from "./reel_loader.js";
export { ReelMesh, type ReelMeshEventMap, type ReelMeshOptions } from "./reel_mesh.js";
