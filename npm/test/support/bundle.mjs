// Bundles internal modules of src/ for tests, and creates instances of the library.

import { build } from "esbuild";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));

/** Root folder of the package. */
export const PACKAGE = join(here, "../..");

/** Return the exports of internals.ts. */
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

/** Instantiate a built module: "reel_whole" uses SIMD, "reel_plain" does not. */
export function newLibrary(Library, name = "reel_whole") {
  return Library.instantiate(new WebAssembly.Module(readFileSync(join(PACKAGE, "wasm", `${name}.wasm`))));
}

/** Open an engine for bytes in memory. */
export async function openEngine({ Engine, Library }, bytes, name, memory = 2 ** 31, segment = null) {
  const read = async (start, end) => bytes.slice(start, end);
  const parameters = { size: bytes.length, hasRanges: true, memory, segment };
  const library = await newLibrary(Library, name);
  const engine = await Engine.open(library, read, parameters, new AbortController().signal);
  return Object.assign(engine, { library });
}
