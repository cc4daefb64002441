// Builds the page: one HTML file with its scripts and styles inside, which needs nothing else.
import { build } from "esbuild";
import { mkdir, readFile, rename, writeFile } from "node:fs/promises";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const page = join(here, "../src/meshreel/viewer/page/index.html");

async function bundle(entry) {
  const result = await build({
    entryPoints: [join(here, entry)],
    bundle: true,
    minify: true,
    write: false,
    format: "iife",
    target: "es2022",
    charset: "utf8",
    legalComments: "none",
  });
  return result.outputFiles[0].text;
}

const [template, script, style, license] = await Promise.all([
  readFile(join(here, "index.html"), "utf8"),
  bundle("src/main.ts"),
  bundle("style.css"),
  readFile(join(here, "node_modules/three/LICENSE"), "utf8"),
]);

// Functions, since "$&" in a bundle would mean something to replace().
const html = template
  .replace("<!--license-->", () => `<!-- Contains three.js.\n${license.trim()}\n-->`)
  .replace("<!--style-->", () => `<style>${style.replaceAll("</style", "<\\/style")}</style>`)
  .replace("<!--script-->", () => `<script>${script.replaceAll("</script", "<\\/script")}</script>`);

await mkdir(dirname(page), { recursive: true });
await writeFile(`${page}.new`, html);
await rename(`${page}.new`, page);
console.log(`${page}: ${Math.round(html.length / 1000)} kB`);
