// Bundles only the parts of three.js that a player needs: its modules instead of its bundle, without
// features that no mesh of a file uses. Users of the npm package bring their own three.js; this is
// for scripts that contain it.

import { existsSync, readFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const SOURCES = join(dirname(fileURLToPath(import.meta.url)), "node_modules/three/src");

/**
 * Features of shaders that no material of a player turns on, so that their code is removed: those of
 * MeshPhysicalMaterial, and of skinned, morphed and instanced meshes.
 */
const UNUSED = new Set(
  `ALPHAHASH ANISOTROPY ANISOTROPYMAP BATCHING BATCHING_COLOR BUMPMAP CLEARCOAT CLEARCOATMAP
  CLEARCOAT_NORMALMAP CLEARCOAT_ROUGHNESSMAP DISPERSION DISPLACEMENTMAP FOG INSTANCING
  INSTANCING_COLOR INSTANCING_MORPH IRIDESCENCE IRIDESCENCEMAP IRIDESCENCE_THICKNESSMAP LIGHTMAP
  LOGARITHMIC_DEPTH_BUFFER MORPHCOLORS MORPHNORMALS MORPHTARGETS SHEEN SHEEN_COLORMAP
  SHEEN_ROUGHNESSMAP SKINNING SPECULAR SPECULAR_COLORMAP SPECULAR_INTENSITYMAP THICKNESSMAP
  TRANSMISSION TRANSMISSIONMAP`
    .split(/\s+/)
    .map((name) => `USE_${name}`),
);

/** Shaders of materials that a player does not have. */
const UNUSED_SHADERS = [
  ...["backgroundCube", "linedashed", "meshlambert", "meshmatcap", "meshnormal", "meshphong"],
  ...["meshtoon", "sprite", "distance"],
].map((name) => join(SOURCES, "renderers/shaders/ShaderLib", `${name}.glsl.js`));

const XR_MANAGER = join(SOURCES, "renderers/webxr/WebXRManager.js");

for (const path of [...UNUSED_SHADERS, XR_MANAGER]) {
  if (!existsSync(path)) throw new Error(`three.js has no ${path}; adapt three_subset.mjs to this version`);
}

/** A renderer without headsets. */
const NO_XR = `
export class WebXRManager {
  enabled = false;
  isPresenting = false;
  cameraAutoUpdate = true;
  addEventListener() {}
  removeEventListener() {}
  setAnimationLoop() {}
  getEnvironmentBlendMode() {}
  getDepthSensingMesh() { return null; }
  hasDepthSensing() { return false; }
  getCamera() {}
  updateCamera() {}
  dispose() {}
}`;

/** Plug-in for esbuild. */
export const threeSubset = {
  name: "three subset",
  setup(bundler) {
    bundler.onResolve({ filter: /^three$/ }, () => ({ path: join(SOURCES, "Three.js"), sideEffects: false }));
    bundler.onLoad({ filter: /three[\\/]src[\\/].*\.js$/ }, ({ path }) => {
      const source = readFileSync(path, "utf8");
      if (path === XR_MANAGER) return { contents: NO_XR };
      if (!path.endsWith(".glsl.js")) return { contents: source };
      if (UNUSED_SHADERS.includes(path)) {
        return { contents: 'export const vertex = "";\nexport const fragment = "";\n' };
      }
      const contents = source.replace(/\/\* glsl \*\/\s*`([^]*?)`/g, (_, glsl) => `\`${reduce(glsl)}\``);
      return { contents };
    });
  },
};

/** Remove comments, indentation and the code of unused features from a shader. */
function reduce(glsl) {
  const lines = glsl.replace(/\/\*[^]*?\*\//g, "").replace(/\/\/.*/g, "").split("\n");
  return removeUnused(lines.map((line) => line.trim()).filter(Boolean)).join("\n");
}

/** Evaluate conditions that consist of one unused feature; others stay. */
function removeUnused(lines) {
  const kept = [];
  /** Open conditions: whether their directives are removed, and whether their current branch stays. */
  const open = [];
  const isKept = () => open.every((one) => one.keeps);
  for (const line of lines) {
    const [, directive, condition] = /^#\s*(ifdef|ifndef|if|elif|else|endif)\b\s*(.*)$/.exec(line) ?? [];
    const top = open.at(-1);
    if (directive?.startsWith("if")) {
      const pattern = directive === "if" ? /^defined\s*\(\s*(\w+)\s*\)$/ : /^(\w+)$/;
      const isRemoved = UNUSED.has(pattern.exec(condition)?.[1]);
      if (!isRemoved && isKept()) kept.push(line);
      open.push({ isRemoved, keeps: !isRemoved || directive === "ifndef" });
    } else if (directive === "endif") {
      open.pop();
      if (!top.isRemoved && isKept()) kept.push(line);
    } else if (directive && top.isRemoved) {
      if (directive === "elif") throw new Error(`cannot remove the condition before ${line}`);
      top.keeps = !top.keeps;
    } else if (isKept()) kept.push(line);
  }
  if (open.length) throw new Error("a condition of a shader is not closed");
  return kept;
}
