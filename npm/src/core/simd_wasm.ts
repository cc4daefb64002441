// The core with vectors, inside the script; bundles begin with it, since they are packed best so.

/** The module, packed, in base 64; build.mjs puts it here. */
declare const SIMD_MODULE: string;

/** The module of the core with vectors, as unpack.ts has it, in base 64. */
export const SIMD_WASM = SIMD_MODULE;
