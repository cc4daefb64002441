// Builds the page: its HTML with styles inside, and its script, beside it and packed.
//
// It uses the package in ../npm, which has to be built first. The page is part of the repository, so that
// installing meshreel needs no Node; `node build.mjs FOLDER` writes it elsewhere, for comparison.
import { build } from "esbuild";
import { mkdir, readFile, rename, writeFile } from "node:fs/promises";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const folder = process.argv[2] ?? join(here, "../src/meshreel/app/viewer/page");

const common = {
  bundle: true,
  minify: true,
  write: false,
  metafile: true,
  format: "iife",
  target: "es2022",
  charset: "utf8",
  legalComments: "eof", // notices of three.js
};

/** The package is a link to a folder that has a three.js of its own; there is to be one. */
const oneThree = {
  name: "one three",
  setup(bundler) {
    bundler.onResolve({ filter: /^three$/ }, ({ kind, resolveDir }) =>
      resolveDir === here ? null : bundler.resolve("three", { kind, resolveDir: here }),
    );
  },
};

/** `import text from "./name.ts?script"` gives the text of a script: that of a worker. */
const scriptText = {
  name: "script text",
  setup(bundler) {
    bundler.onResolve({ filter: /\?script$/ }, ({ path, resolveDir }) => ({
      path: join(resolveDir, path.replace("?script", "")),
      namespace: "script",
    }));
    bundler.onLoad({ filter: /.*/, namespace: "script" }, async ({ path }) => ({
      contents: await bundle(path),
      loader: "text",
    }));
  },
};

/** Packages inside the page, whose licences go with it. */
const LICENSED = ["three"];

async function bundle(entry) {
  const result = await build({ ...common, entryPoints: [entry], plugins: [scriptText, oneThree] });
  for (const input of Object.keys(result.metafile.inputs)) {
    const name = /.*node_modules\/((?:@[^/]+\/)?[^/]+)/.exec(input)?.[1];
    if (name && !LICENSED.includes(name)) {
      throw new Error(`the page bundles ${name}, whose licence is not in LICENSED and THIRD_PARTY_LICENSES`);
    }
  }
  return result.outputFiles[0].text;
}

const [template, script, style, license] = await Promise.all([
  readFile(join(here, "index.html"), "utf8"),
  bundle(join(here, "src/main.ts")),
  bundle(join(here, "style.css")),
  readFile(join(here, "node_modules/three/LICENSE"), "utf8"),
]);

// Functions, since "$&" in a bundle would mean something to replace().
const html = template
  .replace("<!--license-->", () => `<!-- Contains three.js.\n${license.trim()}\n-->`)
  .replace("<!--style-->", () => `<style>${style.replaceAll("</style", "<\\/style")}</style>`);

await mkdir(folder, { recursive: true });
for (const [name, text] of [
  ["player.js", `${script.replaceAll("</script", "<\\/script")}\n/* Contains three.js.\n\n${license.trim()}\n*/\n`],
  ["index.html", html],
]) {
  await writeFile(join(folder, `${name}.new`), text);
  await rename(join(folder, `${name}.new`), join(folder, name));
  console.log(`${name}: ${Math.round(text.length / 1000)} kB`);
}
