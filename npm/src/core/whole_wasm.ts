// The library with all it decodes, with vectors; it is loaded where tracks or exact positions are
// asked for.

/** The module in base 64; build.mjs puts it here. */
declare const WHOLE_MODULE: string;

/** The module, deflated, in base 64. */
export const WHOLE_WASM = WHOLE_MODULE;
