// The part of the library that decodes what most files contain, with SIMD. It comes first in bundles,
// where gzip compresses it best.

/** Inserted by build.mjs. */
declare const SIMD_MODULE: string;

/** The module, separated into streams, as a zlib stream in base64. */
export const SIMD_WASM = SIMD_MODULE;
