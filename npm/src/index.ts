// What `import ... from "meshreel"` gives. First comes what brings the core: see simd_wasm.ts.

export { loadCore } from "./core/module.js";
export type { Core } from "./core/core.js";
export type { DecodedBlock } from "./decode/decoded_block.js";
export { MemoryReel } from "./decode/memory_reel.js";
export * from "./errors.js";
export type * from "./types.js";
