// Modules of src/ for tests, and instances of the core.

import { build } from "esbuild";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));

/** The folder of the package. */
export const PACKAGE = join(here, "../..");

/** What internals.ts exports. */
export async function loadInternals() {
  const folder = mkdtempSync(join(tmpdir(), "meshreel-"));
  try {
    const outfile = join(folder, "internals.mjs");
    const entryPoints = [join(here, "internals.ts")];
    await build({ entryPoints, bundle: true, format: "esm", target: "es2022", outfile });
    return await import(pathToFileURL(outfile).href);
  } finally {
    rmSync(folder, { recursive: true });
  }
}

/** The bytes of the module that decodes exact values. */
export function exactModule() {
  return readFileSync(join(PACKAGE, "wasm/reel_exact.wasm"));
}

/** A new instance of a module that was built: "reel" has vectors, "reel_plain" has none. */
export function newCore(Core, name = "reel") {
  const module = new WebAssembly.Module(readFileSync(join(PACKAGE, "wasm", `${name}.wasm`)));
  return new Core(new WebAssembly.Instance(module));
}
