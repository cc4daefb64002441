// Internal modules of the package for tests.

export { Heap } from "../../src/core/heap.js";
export { Library } from "../../src/core/library.js";
export { Ranges } from "../../src/engine/ranges.js";
export { SegmentsEngine } from "../../src/engine/segments_engine.js";
export * from "../../src/errors.js";
