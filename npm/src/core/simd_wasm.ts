// The core with vectors, inside the script; bundles begin with it, since they are packed best so.

/** The module, deflated, in base 64; build.mjs puts it here. */
declare const SIMD_MODULE: string;

/** The module of the core with vectors, as a zlib stream in base 64. */
export const SIMD_WASM = SIMD_MODULE;
