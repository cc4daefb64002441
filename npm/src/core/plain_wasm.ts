// The whole library without SIMD, loaded on demand by engines that lack SIMD.

/** Inserted by build.mjs. */
declare const PLAIN_MODULE: string;

/** The module in base64. */
export const PLAIN_WASM = PLAIN_MODULE;
