// The part of the library that decodes positions of the method reel and surfaces, with vectors,
// inside the script; bundles begin with it, since they are packed best so.

/** The module, deflated, in base 64; build.mjs puts it here. */
declare const SIMD_MODULE: string;

/** The module as a zlib stream in base 64. */
export const SIMD_WASM = SIMD_MODULE;
