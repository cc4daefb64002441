// Modules of src/ for tests, and instances of the core.

import { build } from "esbuild";
import { readFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));

/** The folder of the package. */
export const PACKAGE = join(here, "../..");

/** What internals.ts exports. */
export async function loadInternals() {
  const result = await build({
    entryPoints: [join(here, "internals.ts")],
    bundle: true,
    format: "esm",
    target: "es2022",
    write: false,
  });
  const text = Buffer.from(result.outputFiles[0].text).toString("base64");
  return import(`data:text/javascript;base64,${text}`);
}

/** A new instance of a module that was built: "reel" has vectors, "reel_plain" has none. */
export function newCore(Core, name = "reel") {
  const module = new WebAssembly.Module(readFileSync(join(PACKAGE, "wasm", `${name}.wasm`)));
  return new Core(new WebAssembly.Instance(module));
}
