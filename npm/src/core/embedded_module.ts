// The complete library in a script: for pages of one file, and where the files of modules are missing.

/** `reel_full.wasm` as a zlib stream in base64; inserted by build.mjs. */
declare const WASM_MODULE: string;

export const packed = WASM_MODULE;
