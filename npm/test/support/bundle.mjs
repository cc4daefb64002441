// Modules of src/ for tests, and instances of the library.

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

/** A new instance of a module that was built: "reel_whole" has vectors, "reel_plain" has none. */
export function newLibrary(Library, name = "reel_whole") {
  return Library.start(new WebAssembly.Module(readFileSync(join(PACKAGE, "wasm", `${name}.wasm`))));
}

/** An engine of bytes in memory. */
export async function engineOf({ Engine, Library }, bytes, name, memory = 2 ** 31, segment = null) {
  const read = async (start, end) => bytes.slice(start, end);
  const opening = { size: bytes.length, hasRanges: true, memory, segment };
  const library = await newLibrary(Library, name);
  const engine = await Engine.open(library, read, opening, new AbortController().signal);
  return Object.assign(engine, { library });
}
