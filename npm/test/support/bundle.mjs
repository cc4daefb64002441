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

/** Instantiate a built module; the default one decodes everything. */
export function newLibrary(Library, name = "reel_full.wasm") {
  return Library.instantiate(new WebAssembly.Module(readFileSync(join(PACKAGE, "wasm", name))));
}

/** Open an engine for bytes in memory. */
export async function openEngine(internals, bytes, options) {
  const { engine } = await openSegments(internals, bytes, options);
  return engine;
}

/** Open a file in memory and one of its segments; `reads` are the ranges that were read. */
export async function openSegments(
  { SegmentsEngine, Ranges, Library },
  bytes,
  { memory = 2 ** 31, segment = null, module = undefined } = {},
) {
  const reads = [];
  const read = async (start, end) => {
    reads.push([start, end]);
    return bytes.slice(start, end);
  };
  const library = await newLibrary(Library, module);
  const { signal } = new AbortController();
  const parameters = { size: bytes.length, hasRanges: true, memory };
  const file = await SegmentsEngine.open(library, new Ranges(), read, parameters, signal);
  const engine = Object.assign(await file.segment(segment, signal), { library });
  return { file, engine, reads };
}
