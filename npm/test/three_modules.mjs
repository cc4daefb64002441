// Bundles modules of src/three in memory.

import { build } from "esbuild";
import { fileURLToPath } from "node:url";

/** Return the exports of a module of src/three. */
export async function loadModule(name) {
  const { outputFiles } = await build({
    entryPoints: [fileURLToPath(new URL(`../src/three/${name}.ts`, import.meta.url))],
    bundle: true,
    write: false,
    format: "esm",
    target: "es2022",
    logLevel: "error",
  });
  return import(`data:text/javascript,${encodeURIComponent(outputFiles[0].text)}`);
}

/** Wait until pending promise callbacks have run. */
export function settled() {
  return new Promise((resolve) => setImmediate(resolve));
}
