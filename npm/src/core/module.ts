// The library as WebAssembly modules: `reel.wasm` for meshes, and `reel_full.wasm` also for exact values and
// cells.

import { MeshReelError, SourceError } from "../errors.js";
import { openLocalFile } from "../source/local_file.js";
import { errorReason } from "../source/transport.js";

/** Whether the library is part of the script, as in a page of one file; inserted by build.mjs. */
declare const IS_EMBEDDED: boolean;

/** A module next to the built script. */
interface ModuleFile {
  url(): URL;
  loading?: Promise<WebAssembly.Module>;
}

// Bundlers look for this literal form of addresses.
const MESHES: ModuleFile = { url: () => new URL("./reel.wasm", import.meta.url) };
const FULL: ModuleFile = { url: () => new URL("./reel_full.wasm", import.meta.url) };

/**
 * Compile a module once, and return it to all callers; it can be sent to workers.
 *
 * @param isFull - whether it must decode exact values and cells. Others may, too.
 * @throws MeshReelError if the engine lacks WebAssembly with SIMD.
 * @throws SourceError if the module cannot be loaded.
 * @throws WebAssembly.CompileError if the Content-Security-Policy of the page forbids WebAssembly;
 * it must allow `script-src 'wasm-unsafe-eval'`.
 */
export function loadModule(isFull = false): Promise<WebAssembly.Module> {
  const file = isFull ? FULL : MESHES;
  file.loading ??= load(file).catch((error: unknown) => {
    file.loading = undefined; // the next call tries again
    throw error;
  });
  return file.loading;
}

async function load(file: ModuleFile): Promise<WebAssembly.Module> {
  const bytes = IS_EMBEDDED ? await unpack() : await download(file).catch(unpack);
  return WebAssembly.compile(bytes).catch((error: Error) => {
    if (!WebAssembly.validate(bytes)) throw tooOld("WebAssembly SIMD");
    throw new WebAssembly.CompileError(
      "the Content-Security-Policy of this page forbids WebAssembly; add 'wasm-unsafe-eval' to its" +
        ` script-src (${error.message})`,
    );
  });
}

async function download(file: ModuleFile): Promise<BufferSource> {
  const url = file.url();
  const response = await (url.protocol === "file:" ? openLocalFile(url.href) : fetch(url));
  const bytes = "read" in response ? await response.read(0, 2 ** 30) : new Uint8Array(await response.arrayBuffer());
  if (String(bytes.subarray(0, 4)) !== "0,97,115,109") throw new Error(`${url} is not WebAssembly`); // but a page
  return bytes as Uint8Array<ArrayBuffer>;
}

/** Load the script with the complete library, after a failure to load a module by itself. */
async function unpack(cause?: unknown): Promise<BufferSource> {
  const { packed } = await import("./embedded_module.js").catch(() => {
    throw new SourceError(
      `the decoder cannot be loaded (${errorReason(cause)}); serve reel.wasm and reel_full.wasm of the package` +
        " next to its script",
      { cause },
    );
  });
  if (typeof DecompressionStream === "undefined") throw tooOld("DecompressionStream");
  const bytes = Uint8Array.from(atob(packed), (character) => character.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).arrayBuffer();
}

function tooOld(feature: string): MeshReelError {
  return new MeshReelError(
    `this JavaScript engine lacks ${feature}; decoding needs Chrome 91, Firefox 113, Safari 16.4 or Node 20`,
  );
}
