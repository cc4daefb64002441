// Builds dist/: the C library as WebAssembly, bundles of the scripts with it inside, declarations.
//
// The core is compiled by core/compile.py, which needs Python with the package `ziglang`; PYTHON
// names the interpreter.

import zopfli from "@gfx/zopfli";
import { build } from "esbuild";
import { execFile, execFileSync } from "node:child_process";
import { copyFileSync, existsSync, mkdirSync, readFileSync, readdirSync, rmSync, statSync, writeFileSync } from "node:fs";
import { basename, dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { promisify } from "node:util";
import { gzipSync } from "node:zlib";

const here = dirname(fileURLToPath(import.meta.url));
const core = join(here, "../core");
const dist = join(here, "dist");
const modules = join(here, "wasm");

const started = promisify(execFile);

function run(command, ...given) {
  execFileSync(command, given, { cwd: here, stdio: "inherit" });
}

/** The bytes of a module, compiled where a source is newer. */
async function compiled(target, name) {
  const path = join(modules, name);
  const sources = ["", "reader", "include"].flatMap((folder) =>
    readdirSync(join(core, folder)).map((file) => join(core, folder, file)),
  );
  const isNewer = (file) => /\.([ch]|py)$/.test(file) && statSync(file).mtimeMs > statSync(path).mtimeMs;
  if (!existsSync(path) || sources.some(isNewer)) {
    mkdirSync(modules, { recursive: true });
    const python = process.env.PYTHON ?? "python3";
    await started(python, [join(core, "compile.py"), "--target", target, "-o", path]);
  }
  return readFileSync(path);
}

/** Bytes as a zlib stream, in base 64. */
function deflated(bytes) {
  return new Promise((resolve, reject) => {
    zopfli.zlib(bytes, { numiterations: 15 }, (error, packed) =>
      error ? reject(error) : resolve(Buffer.from(packed).toString("base64")),
    );
  });
}

const [quick, whole, plain] = await Promise.all([
  compiled("wasm", "reel.wasm"),
  compiled("wasm-whole", "reel_whole.wasm"),
  compiled("wasm-plain", "reel_plain.wasm"),
]);

/** The engine and all that it needs, inside one function: its text is the script of a worker. */
const engineInside = {
  name: "engine inside",
  setup(bundler) {
    bundler.onLoad({ filter: /[\\/]engine_function\.ts$/ }, async () => {
      const { outputFiles } = await build({
        entryPoints: [join(here, "src/engine/start.ts")],
        bundle: true,
        minify: true,
        write: false,
        format: "iife",
        globalName: "engine",
        // As old as can be: what bundlers would rewrite, they would rewrite with help from outside.
        target: "es2020",
      });
      const script = outputFiles[0].text;
      return { contents: `export function startEngine(port) {${script}engine.start(port);}` };
    });
  },
};

/** What `meshreel` exports is that of the script beside, wherever it is imported. */
const indexBeside = {
  name: "index beside",
  setup(bundler) {
    bundler.onResolve({ filter: /^\.\.(\/\.\.)*\/(index|errors)\.js$/ }, () => ({
      path: "./index.js",
      external: true,
    }));
  },
};

/** Keeps modules out of a bundle: it imports the scripts in dist/ that have their names. */
function beside(filter) {
  return {
    name: "scripts beside",
    setup(bundler) {
      bundler.onResolve({ filter }, ({ path }) => ({ path: `./${basename(path)}`, external: true }));
    },
  };
}

const common = {
  bundle: true,
  minify: true,
  metafile: true,
  format: "esm",
  target: "es2022",
  charset: "utf8",
  legalComments: "none",
  absWorkingDir: here,
};

const threeLicense = readFileSync(join(here, "node_modules/three/LICENSE"), "utf8");

rmSync(dist, { recursive: true, force: true });
const modulesInside = {
  // Deflated bytes in base 64 are packed by gzip to little more than the deflated bytes, and
  // zopfli, which takes its time, deflates to 5 % less than zlib does.
  SIMD_MODULE: JSON.stringify(await deflated(quick)),
  PLAIN_MODULE: JSON.stringify(plain.toString("base64")),
  WHOLE_MODULE: JSON.stringify(await deflated(whole)),
};
const decoder = await build({
  ...common,
  entryPoints: ["src/index.ts"],
  splitting: true,
  outdir: dist,
  plugins: [engineInside, beside(/\/local_file\.js$/)],
  chunkNames: "[name]",
  define: modulesInside,
});
const localFile = await build({
  ...common,
  entryPoints: ["src/source/local_file.ts"],
  outdir: dist,
  minify: false, // it would drop the comments that tell bundlers to leave an import alone
});
const three = await build({
  ...common,
  entryPoints: { three: "src/three/index.ts" },
  splitting: true, // textures, and pictures without a GPU, are scripts that few load
  outdir: dist,
  external: ["three"],
  plugins: [indexBeside],
  chunkNames: "three_[name]",
});
// For pages without a bundler: one script, with the decoder and what it takes of three.js inside.
// The module for engines without vectors, which hardly any browser is, stays beside; so does that
// which decodes tracks and exact values.
const player = await build({
  ...common,
  entryPoints: ["src/player/index.ts"],
  outfile: join(dist, "player.js"),
  // Modules that few need and files in Node are scripts of `meshreel`, too.
  plugins: [engineInside, beside(/\/(plain_wasm|whole_wasm|local_file)\.js$/)],
  define: modulesInside,
  legalComments: "eof", // the notices of three.js, whose licence follows
  footer: { js: `/* Contains three.js.\n\n${threeLicense.trim()}\n*/` },
});
run(process.execPath, "node_modules/typescript/bin/tsc", "--declaration", "--emitDeclarationOnly", "--outDir", "dist");
// Types only; the empty script is for those who import it all the same.
copyFileSync(join(here, "src/player/jsx.d.ts"), join(dist, "player/jsx.d.ts"));
writeFileSync(join(dist, "player/jsx.js"), "export {};\n");
writeFileSync(join(dist, "built"), ""); // all is there

const files = [decoder, localFile, three, player].flatMap(({ metafile }) => Object.keys(metafile.outputs));
for (const file of files) {
  const bytes = readFileSync(join(here, file));
  const packed = gzipSync(bytes, { level: 9 }).length;
  console.log(`${file}: ${bytes.length} bytes, ${packed} after gzip`);
}
