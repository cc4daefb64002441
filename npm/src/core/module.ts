// The library as a WebAssembly module, from bytes that are part of a script.

import { SIMD_WASM } from "./simd_wasm.js";

/** A module whose only function has a vector: valid where engines know vectors of 128 bits. */
const PROBE = [
  0, 97, 115, 109, 1, 0, 0, 0, 1, 5, 1, 96, 0, 1, 123, 3, 2, 1, 0, 10, 10, 1, 8, 0, 65, 0, 253, 15,
  253, 98, 11,
];

/** What a module decodes: positions of the method reel and surfaces, or everything. */
export type Scope = "positions" | "whole";

const loading = new Map<Scope, Promise<WebAssembly.Module>>();

/**
 * A module of the library, compiled once for all that ask; it may be sent to workers.
 *
 * With vectors where the engine has them. Engines that have none, or cannot inflate, load a plain
 * one: a file beside this script, which decodes the same bits slower.
 *
 * @throws WebAssembly.CompileError where the content policy of the page forbids WebAssembly; it
 * has to allow `script-src 'wasm-unsafe-eval'`.
 */
export function loadModule(scope: Scope): Promise<WebAssembly.Module> {
  const found = loading.get(scope) ?? compile(scope).catch((error: unknown) => refuse(scope, error));
  loading.set(scope, found);
  return found;
}

function refuse(scope: Scope, error: unknown): never {
  loading.delete(scope); // the file may come another time
  // The bytes are ours, and sound: only a policy refuses them.
  if (!(error instanceof WebAssembly.CompileError)) throw error;
  throw new WebAssembly.CompileError(
    "the Content-Security-Policy of this page forbids WebAssembly; add 'wasm-unsafe-eval' to its" +
      ` script-src (${error.message})`,
  );
}

async function compile(scope: Scope): Promise<WebAssembly.Module> {
  const isQuick =
    typeof DecompressionStream !== "undefined" && WebAssembly.validate(new Uint8Array(PROBE));
  if (!isQuick) {
    const { PLAIN_WASM } = await import("./plain_wasm.js");
    return WebAssembly.compile(fromBase64(PLAIN_WASM));
  }
  const packed = scope === "whole" ? (await import("./whole_wasm.js")).WHOLE_WASM : SIMD_WASM;
  return WebAssembly.compile(await inflated(fromBase64(packed)));
}

function fromBase64(text: string): Uint8Array<ArrayBuffer> {
  const letters = atob(text);
  const bytes = new Uint8Array(letters.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = letters.charCodeAt(i);
  return bytes;
}

async function inflated(bytes: Uint8Array<ArrayBuffer>): Promise<ArrayBuffer> {
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
