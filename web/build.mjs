// Builds the page: one HTML file with inline styles, and one script.
//
// Build the package in ../npm first. The built page is committed, so that installing meshreel does not need
// Node; `node build.mjs FOLDER` writes it to another folder, for comparison.
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

/** The linked package has its own copy of three.js; bundle only that of this folder. */
const oneThree = {
  name: "one three",
  setup(bundler) {
    bundler.onResolve({ filter: /^three$/ }, ({ kind, resolveDir }) =>
      resolveDir === here ? null : bundler.resolve("three", { kind, resolveDir: here }),
    );
  },
};

/** `import text from "./name.ts?script"` imports a bundled module as text, for workers. */
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

/** Bundled packages, whose licenses are included in the page. */
const LICENSED = ["three"];

async function bundle(entry) {
  const result = await build({ ...common, entryPoints: [entry], plugins: [scriptText, oneThree] });
  for (const input of Object.keys(result.metafile.inputs)) {
    const name = /.*node_modules\/((?:@[^/]+\/)?[^/]+)/.exec(input)?.[1];
    if (name && !LICENSED.includes(name)) {
      throw new Error(`the page bundles ${name}, whose license is not in LICENSED and THIRD_PARTY_LICENSES`);
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

// Replacement functions, since "$&" in a bundle would be special in a replacement string.
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
