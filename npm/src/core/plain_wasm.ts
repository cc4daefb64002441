// The whole library without vectors, for engines that have none; it is loaded where it is needed.

/** The module in base 64; build.mjs puts it here. */
declare const PLAIN_MODULE: string;

/** The plain module, in base 64. */
export const PLAIN_WASM = PLAIN_MODULE;
