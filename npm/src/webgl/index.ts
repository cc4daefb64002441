// A small renderer for the player, with the names of three.js: modules of `three/` that import
// "three" are bundled with this one instead for the player and the page.

export * from "./geometry.js";
export * from "./materials.js";
export * from "./math.js";
export * from "./objects.js";
export * from "./raycaster.js";
export { WebGLRenderer } from "./renderer.js";
export * from "./textures.js";
