// Builds the package and the page of `meshreel view` and `meshreel export`.
//
//     node build.mjs package         dist/: bundles, the C library as WebAssembly, and types; and
//                                    site/three_figure.js, for the gallery of the documentation
//     node build.mjs page [FOLDER]   one HTML file with inline styles, and its script player.js; by
//                                    default into src/meshreel/app/viewer/page, which is committed, so
//                                    that installing meshreel does not need Node
//
// Both without arguments. core/compile.py compiles the core; it needs Python with the package
// `ziglang`. Set PYTHON to the interpreter.

import zopfli from "@gfx/zopfli";
import { build } from "esbuild";
import { execFileSync } from "node:child_process";
import { copyFileSync, existsSync, mkdirSync, readFileSync, readdirSync, renameSync, rmSync, statSync, writeFileSync } from "node:fs";
import { basename, dirname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { promisify } from "node:util";
import { gzipSync } from "node:zlib";
import { minify } from "terser";

const here = dirname(fileURLToPath(import.meta.url));
const core = join(here, "../core");
const dist = join(here, "dist");
const wasm = join(here, "wasm");
/** Modules and their targets in core/compile.py: the decoder of meshes, and the complete one. */
const MODULES = { "reel.wasm": "wasm-meshes", "reel_full.wasm": "wasm" };

function run(command, ...args) {
  execFileSync(command, args, { cwd: here, stdio: "inherit" });
}

/** Compile the C library to WebAssembly in wasm/ if a source is newer. */
function compileCore() {
  const sources = ["", "reader", "include"].flatMap((folder) =>
    readdirSync(join(core, folder)).map((file) => join(core, folder, file)),
  );
  mkdirSync(wasm, { recursive: true });
  for (const [name, target] of Object.entries(MODULES)) {
    const built = join(wasm, name);
    const isNewer = (file) => /\.([ch]|py)$/.test(file) && statSync(file).mtimeMs > statSync(built).mtimeMs;
    if (existsSync(built) && !sources.some(isNewer)) continue;
    run(process.env.PYTHON ?? "python3", join(core, "compile.py"), "--target", target, "-o", built);
  }
}

/** Return bytes as a zlib stream in base64. */
async function pack(bytes) {
  const packed = await promisify(zopfli.zlib)(bytes, {}); // 5 % smaller than with zlib
  return Buffer.from(packed).toString("base64");
}

compileCore();

/** Inserted into scripts that contain the complete library. */
const embedded = {
  IS_EMBEDDED: "true",
  WASM_MODULE: JSON.stringify(await pack(readFileSync(join(wasm, "reel_full.wasm")))),
};

/**
 * Shrink a bundled script further, smaller after gzip than with esbuild alone.
 *
 * @param isReadable - keep names of classes and line breaks, for stack traces and debuggers
 * @param sourceMap - options of terser
 */
async function shrink(script, isReadable = false, sourceMap = undefined) {
  // esbuild writes classes as expressions; their names are those of their variables, or "_" and those.
  const classes = [...script.matchAll(/\b(\w+) = class\b/g)].map(([, name]) => name);
  const named = isReadable ? script.replace(/\b_(\w+)\b/g, (all, name) => (classes.includes(name) ? name : all)) : script;
  const { code, map } = await minify(named, {
    module: true,
    ecma: 2020,
    compress: { passes: 3 },
    mangle: { keep_classnames: isReadable, reserved: isReadable ? classes : [] },
    keep_classnames: isReadable,
    // Node prints the line of an error, which must not be the whole script.
    format: { comments: /webpackIgnore|@vite-ignore/, max_line_len: isReadable ? 200 : false },
    sourceMap,
  });
  return { code, map };
}

/** Shrink a built script and its source map in place. */
async function shrinkFile(path, isReadable) {
  const content = readFileSync(`${path}.map`, "utf8");
  const url = `${basename(path)}.map`;
  const { code, map } = await shrink(readFileSync(path, "utf8"), isReadable, { content, url });
  writeFileSync(path, code);
  writeFileSync(`${path}.map`, map);
}

/** Removes comments and unnecessary spaces from shaders and style sheets in scripts. */
const shrinkTexts = {
  name: "shrink texts",
  setup(bundler) {
    const filter = /src[\\/](webgl[\\/]surface_shader|three[\\/]gpu[\\/]\w+|player[\\/](style_sheet|contact_shadow)|page[\\/]shading[\\/]\w+)\.ts$/;
    bundler.onLoad({ filter }, ({ path }) => {
      const shrinkLine = (line) => (line.startsWith("#") ? line : line.replace(/ *([=*/<>,;{}?|&]) */g, "$1"));
      const shrinkText = (text) => {
        const lines = text.split("\n").map((line) => line.replace(/\/\/.*/, "").trim());
        return lines.filter(Boolean).map(shrinkLine).join("\n");
      };
      const literal = /(?<=`)\n[^`]*(?=`)/g;
      const contents = readFileSync(path, "utf8").replace(literal, (text) => `\n${shrinkText(text)}\n`);
      return { contents, loader: "ts" };
    });
  },
};

/** Bundles an engine into one function, whose source text is the script of a worker. */
const embedEngine = (isReadable) => ({
  name: "embed engine",
  setup(bundler) {
    bundler.onLoad({ filter: /[\\/]engine_script\.ts$/ }, async () => {
      const { outputFiles } = await build({
        stdin: { contents: 'import { start } from "./start.js"; start(port);', resolveDir: join(here, "src/engine") },
        bundle: true,
        minify: !isReadable,
        write: false,
        outfile: join(here, "src/file/engine.js"), // sources of the map are relative to it
        sourcemap: "external",
        format: "esm",
        // An old target: bundlers that lower newer syntax would add helpers outside of the function.
        target: "es2020",
      });
      const [map, script] = outputFiles.map(({ text }) => text);
      const wrapped = `export function startEngine(port) {\n${script}}`;
      const shifted = JSON.stringify({ ...JSON.parse(map), mappings: `;${JSON.parse(map).mappings}` });
      const { code } = await shrink(wrapped, isReadable, { content: shifted, url: "inline" });
      return { contents: code };
    });
  },
});

/** Imports the exports of `meshreel` from its script, instead of bundling them again. */
const externalIndex = {
  name: "external index",
  setup(bundler) {
    bundler.onResolve({ filter: /^\.\.(\/\.\.)*\/(index|errors)\.js$/ }, () => ({
      path: "./index.js",
      external: true,
    }));
  },
};

/** Bundles modules of src/three with the renderer of the player in place of three.js. */
const ownRenderer = {
  name: "own renderer",
  setup(bundler) {
    bundler.onResolve({ filter: /^three$/ }, () => ({ path: join(here, "src/webgl/index.ts"), sideEffects: false }));
  },
};

/** Imports the script with the complete library only when it is needed. */
const externalModule = {
  name: "external module",
  setup(bundler) {
    bundler.onResolve({ filter: /^\.\/embedded_module\.js$/ }, ({ path }) => ({ path, external: true }));
  },
};

const common = {
  bundle: true,
  minifySyntax: true, // `shrink` does the rest, but keeps comments for other bundlers
  sourcemap: "external",
  metafile: true,
  format: "esm",
  target: "es2022",
  charset: "utf8",
  legalComments: "none",
  absWorkingDir: here,
};

/** Options of scripts that load the library from files next to them. */
const withFiles = { ...common, define: { IS_EMBEDDED: "false" } };

const threeLicense = readFileSync(join(here, "node_modules/three/LICENSE"), "utf8").trim();
const notice = `Shaders are derived from those of three.js.\n\n${threeLicense}`;

/** Build dist/. */
async function buildPackage() {
  rmSync(dist, { recursive: true, force: true });
  const decoder = await build({
    ...withFiles,
    entryPoints: ["src/index.ts"],
    outdir: dist,
    plugins: [embedEngine(true), externalModule],
  });
  const embeddedModule = await build({
    ...common,
    entryPoints: ["src/core/embedded_module.ts"],
    outdir: dist,
    define: embedded,
  });
  const three = await build({
    ...common,
    entryPoints: { three: "src/three/index.ts" },
    splitting: true, // textures and colors by tracks are loaded on demand
    outdir: dist,
    external: ["three"],
    plugins: [externalIndex],
    chunkNames: "three_[name]_[hash]",
  });
  // For pages without a bundler: one script with the decoder and a renderer.
  const player = await build({
    ...withFiles,
    minifyIdentifiers: true,
    entryPoints: ["src/player/index.ts"],
    outfile: join(dist, "player.js"),
    plugins: [embedEngine(false), ownRenderer, shrinkTexts, externalModule],
  });
  const scripts = ({ metafile }) => Object.keys(metafile.outputs).filter((file) => file.endsWith(".js"));
  const modules = [decoder, embeddedModule, three].flatMap(scripts);
  const files = [...modules, ...scripts(player)];
  for (const file of files) await shrinkFile(join(here, file), modules.includes(file));
  // Before the address of the source map, which must come last.
  const path = join(dist, "player.js");
  writeFileSync(path, readFileSync(path, "utf8").replace(/(?=\/\/# sourceMappingURL)/, () => `/* ${notice}\n*/\n`));
  // The player first: it also emits types of src/three, as seen with its own renderer.
  for (const part of ["player", "package"]) {
    run(process.execPath, "node_modules/typescript/bin/tsc", "--project", `tsconfig.${part}.json`);
  }
  rmSync(join(dist, "page"), { recursive: true });
  // Types only; the empty script allows importing it at run time.
  copyFileSync(join(here, "src/player/jsx.d.ts"), join(dist, "player/jsx.d.ts"));
  writeFileSync(join(dist, "player/jsx.js"), "export {};\n");
  copyFileSync(join(here, "../THIRD_PARTY_LICENSES.md"), join(dist, "THIRD_PARTY_LICENSES.md"));
  for (const name of Object.keys(MODULES)) copyFileSync(join(wasm, name), join(dist, name));
  writeFileSync(join(dist, "built"), ""); // marks a complete build

  for (const file of [...files, ...Object.keys(MODULES).map((name) => join("dist", name))]) {
    const bytes = readFileSync(join(here, file));
    console.log(`${file}: ${bytes.length} bytes, ${gzipSync(bytes, { level: 9 }).length} after gzip`);
  }
}

/** Build the script of the gallery that draws .glb and .reel files with three.js. */
async function buildFigure() {
  await build({
    ...common,
    sourcemap: false,
    minify: true,
    legalComments: "eof",
    entryPoints: ["site/three_figure.ts"],
    outdir: "site",
    plugins: [embedEngine(false)],
    define: embedded,
  });
}

/** Bundle parts of the page; returns the result of esbuild. */
async function bundleForPage(options) {
  const result = await build({
    ...common,
    sourcemap: false,
    minifyIdentifiers: true,
    write: false,
    plugins: [embedEngine(false), ownRenderer, shrinkTexts],
    define: embedded,
    ...options,
  });
  for (const input of Object.keys(result.metafile.inputs)) {
    const name = /.*node_modules\/((?:@[^/]+\/)?[^/]+)/.exec(input)?.[1];
    if (name) throw new Error(`the page bundles ${name}; include its license here and in THIRD_PARTY_LICENSES.md`);
  }
  return result;
}

/** Build the page of `meshreel view` and `meshreel export`. */
async function buildPage(folder) {
  const page = join(here, "src/page");
  const [scripts, styles] = await Promise.all([
    bundleForPage({ entryPoints: { player: join(page, "main.ts") }, outdir: folder }),
    bundleForPage({ entryPoints: [join(page, "style.css")], outdir: folder, minifyWhitespace: true }),
  ]);
  // Replacement functions, since "$&" in a bundle would be special in a replacement string.
  const html = readFileSync(join(page, "index.html"), "utf8")
    .replace("<!--license-->", () => `<!-- ${notice}\n-->`)
    .replace("<!--style-->", () => `<style>${styles.outputFiles[0].text.replaceAll("</style", "<\\/style")}</style>`);
  const { code } = await shrink(scripts.outputFiles[0].text);
  const script = `${code}/* ${notice}\n*/\n`;
  mkdirSync(folder, { recursive: true });
  for (const [name, text] of Object.entries({ "index.html": html, "player.js": script })) {
    writeFileSync(join(folder, `${name}.new`), text);
    renameSync(join(folder, `${name}.new`), join(folder, name));
    const packed = gzipSync(text, { level: 9 }).length;
    console.log(`page/${name}: ${text.length} characters, ${packed} bytes after gzip`);
  }
}

const [target, folder] = process.argv.slice(2);
if (target !== "page") {
  await buildFigure();
  await buildPackage();
}
if (target !== "package") {
  await buildPage(resolve(folder ?? join(here, "../src/meshreel/app/viewer/page")));
}
