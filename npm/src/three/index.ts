// `meshreel/three`: plays files in three.js.

export type { FrameRange, Loop } from "./clock.js";
export type { ColorMap } from "./color/color_map.js";
export type { Component } from "./color/color_range.js";
export type { ColorAttribute, ColorLegend, ColorOptions } from "./color/track_colors.js";
export type { PlaybackEvents } from "./playback.js";
export { ReelLoader, type ReelLoaderOptions } from "./reel_loader.js";
export { ReelMesh, type ReelMeshEventMap, type ReelMeshOptions } from "./reel_mesh.js";
export type { TextureOptions } from "./texture/mesh_texture.js";
export type { TextureSource } from "./texture/texture_source.js";
