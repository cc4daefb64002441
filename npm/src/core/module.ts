// The library as a WebAssembly module, compiled from bytes embedded in a script.

import { SIMD_WASM } from "./simd_wasm.js";
import { joinStreams } from "./wasm_streams.js";

/** A module with one SIMD instruction; it validates only if the engine supports 128-bit SIMD. */
const SIMD_PROBE = [
  0, 97, 115, 109, 1, 0, 0, 0, 1, 5, 1, 96, 0, 1, 123, 3, 2, 1, 0, 10, 10, 1, 8, 0, 65, 0, 253, 15,
  253, 98, 11,
];

/** What a module decodes: what most files contain, or everything. */
export type Scope = "small" | "whole";

const loading = new Map<Scope, Promise<WebAssembly.Module>>();

/**
 * Compile a module of the library once, and return it to all callers; it can be sent to workers.
 *
 * The small module refuses all else: its functions throw a `WebAssembly.RuntimeError`. The module
 * uses SIMD if the engine supports it. Otherwise, or without DecompressionStream, a slower, whole
 * module with identical output is loaded from a separate script.
 *
 * @throws WebAssembly.CompileError if the Content-Security-Policy of the page forbids WebAssembly;
 * it must allow `script-src 'wasm-unsafe-eval'`.
 */
export function loadModule(scope: Scope): Promise<WebAssembly.Module> {
  const module =
    loading.get(scope) ?? compile(scope).catch((error: unknown) => explainFailure(scope, error));
  loading.set(scope, module);
  return module;
}

function explainFailure(scope: Scope, error: unknown): never {
  loading.delete(scope); // the next call tries again
  // The module itself is valid, so that only a content policy can reject it.
  if (!(error instanceof WebAssembly.CompileError)) throw error;
  throw new WebAssembly.CompileError(
    "the Content-Security-Policy of this page forbids WebAssembly; add 'wasm-unsafe-eval' to its" +
      ` script-src (${error.message})`,
  );
}

async function compile(scope: Scope): Promise<WebAssembly.Module> {
  const hasSimd =
    typeof DecompressionStream !== "undefined" && WebAssembly.validate(new Uint8Array(SIMD_PROBE));
  if (!hasSimd) {
    const { PLAIN_WASM } = await import("./plain_wasm.js");
    return WebAssembly.compile(fromBase64(PLAIN_WASM));
  }
  const packed = scope === "whole" ? (await import("./whole_wasm.js")).WHOLE_WASM : SIMD_WASM;
  return WebAssembly.compile(joinStreams(new Uint8Array(await inflate(fromBase64(packed)))));
}

function fromBase64(text: string): Uint8Array<ArrayBuffer> {
  return Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
}

async function inflate(bytes: Uint8Array<ArrayBuffer>): Promise<ArrayBuffer> {
  const { readable, writable } = new DecompressionStream("deflate");
  const writer = writable.getWriter();
  const parts: Uint8Array<ArrayBuffer>[] = [];
  const collect = async (): Promise<void> => {
    const reader = readable.getReader();
    for (;;) {
      const { done, value } = await reader.read();
      if (done) return;
      parts.push(value);
    }
  };
  await Promise.all([writer.write(bytes), writer.close(), collect()]);
  return new Blob(parts).arrayBuffer();
}
