// The library as a WebAssembly module, compiled from bytes embedded in the script.

import { MeshReelError } from "../errors.js";

/** The module as a zlib stream in base64; inserted by build.mjs. */
declare const WASM_MODULE: string;

let loading: Promise<WebAssembly.Module> | null = null;

/**
 * Compile the library once, and return it to all callers; it can be sent to workers.
 *
 * @throws MeshReelError if the engine lacks WebAssembly with SIMD.
 * @throws WebAssembly.CompileError if the Content-Security-Policy of the page forbids WebAssembly;
 * it must allow `script-src 'wasm-unsafe-eval'`.
 */
export function loadModule(): Promise<WebAssembly.Module> {
  loading ??= compile().catch((error: unknown) => {
    loading = null; // the next call tries again
    throw error;
  });
  return loading;
}

async function compile(): Promise<WebAssembly.Module> {
  if (typeof DecompressionStream === "undefined") throw tooOld("DecompressionStream");
  const packed = Uint8Array.from(atob(WASM_MODULE), (character) => character.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = await new Response(stream).arrayBuffer();
  return WebAssembly.compile(bytes).catch((error: Error) => {
    if (!WebAssembly.validate(bytes)) throw tooOld("WebAssembly SIMD");
    throw new WebAssembly.CompileError(
      "the Content-Security-Policy of this page forbids WebAssembly; add 'wasm-unsafe-eval' to its" +
        ` script-src (${error.message})`,
    );
  });
}

function tooOld(feature: string): MeshReelError {
  return new MeshReelError(
    `this JavaScript engine lacks ${feature}; decoding needs Chrome 91, Firefox 113, Safari 16.4 or Node 20`,
  );
}
