// The whole library with SIMD, loaded on demand for files that the small module refuses.

/** Inserted by build.mjs. */
declare const WHOLE_MODULE: string;

/** The module, separated into streams, as a zlib stream in base64. */
export const WHOLE_WASM = WHOLE_MODULE;
