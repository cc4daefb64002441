// What `import ... from "meshreel"` gives.

export * from "./errors.js";
export type * from "./types.js";
export type { Core } from "./core/core.js";
export { loadCore } from "./core/module.js";
export type { DecodedBlock } from "./decode/decoded_block.js";
export { MemoryReel } from "./decode/memory_reel.js";
