// The modules of `meshreel/three` that need no three.js, built in memory.

import { build } from "esbuild";
import { fileURLToPath } from "node:url";

/** The exports of a module of src/three. */
export async function moduleOf(name) {
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

/** Lets everything that waits for promises go on. */
export function settled() {
  return new Promise((resolve) => setImmediate(resolve));
}
