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
  TRANSMISSION TRANSMISSIONMAP DIFFUSE_ROUGHNESS DIFFUSE_ROUGHNESSMAP RETROREFLECTION TANGENT
  GRADIENTMAP MATCAP CLIP_DISTANCE PACKED_NORMALMAP SPECULARMAP ALPHAMAP REVERSED_DEPTH_BUFFER`
    .split(/\s+/)
    .map((name) => `USE_${name}`)
    .concat("SHADOWMAP_TYPE_PCF", "SHADOWMAP_TYPE_BASIC"), // shadows of a player are of type VSM
);

/** Conditions on lights that a player does not have; it has directional and hemisphere lights. */
const UNUSED_LIGHTS =
  /^\(?\s*(defined\( USE_SHADOWMAP \) && )?NUM_(POINT|RECT_AREA|SPOT|SUN)_LIGHT\w* > 0\s*\)?( && .*)?$/;

/** Functions of area lights. */
const UNUSED_FUNCTIONS = /^\w+ LTC_\w+\([^]*?^}$/gm;

/** Methods that convert objects from and to JSON. */
const JSON_METHODS = /\n\t(static )?(toJSON|fromJSON)\([^]*?\n\t}\n/g;

/** Shaders of materials that a player does not have. */
const UNUSED_SHADERS = [
  ...["backgroundCube", "linedashed", "meshlambert", "meshmatcap", "meshnormal", "meshphong"],
  ...["meshtoon", "sprite", "distance"],
].map((name) => join(SOURCES, "renderers/shaders/ShaderLib", `${name}.glsl.js`));

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

/** Modules of the renderer that a player does not use, and what replaces them. */
const REPLACED = new Map(
  Object.entries({
    "webxr/WebXRManager.js": NO_XR,
    "webgl/WebGLUniformsGroups.js": "export function WebGLUniformsGroups() { return { dispose() {} }; }",
    "webgl/WebGLMorphtargets.js": "export function WebGLMorphtargets() {}",
    "webgl/WebGLOutput.js": "export class WebGLOutput {}", // for post-processing
    "shaders/ShaderChunk/tonemapping_pars_fragment.glsl.js": 'export default "";',
  }).map(([path, contents]) => [join(SOURCES, "renderers", path), contents]),
);

/** Functions of the renderer that a player does not reach. */
const EMPTIED = new Map(
  Object.entries({
    "WebGLRenderer.js": [
      ...["compileAsync", "copyFramebufferToTexture", "copyTextureToTexture"],
      ...["readRenderTargetPixelsAsync", "renderTransmissionPass", "setEffects"],
    ],
    "webgl/WebGLMaterials.js": [
      ...["refreshFogUniforms", "refreshUniformsDash", "refreshUniformsDistance", "refreshUniformsMatcap"],
      ...["refreshUniformsPhong", "refreshUniformsPhysical", "refreshUniformsSprites", "refreshUniformsToon"],
    ],
    "webgl/WebGLTextures.js": ["updateMultisampleRenderTarget", "uploadCubeTexture"],
  }).map(([path, names]) => [join(SOURCES, "renderers", path), names]),
);

for (const path of [...UNUSED_SHADERS, ...REPLACED.keys()]) {
  if (!existsSync(path)) throw new Error(`three.js has no ${path}; adapt three_subset.mjs to this version`);
}

/** Plug-in for esbuild. */
export const threeSubset = {
  name: "three subset",
  setup(bundler) {
    bundler.onResolve({ filter: /^three$/ }, () => ({ path: join(SOURCES, "Three.js"), sideEffects: false }));
    bundler.onLoad({ filter: /three[\\/]src[\\/].*\.js$/ }, ({ path }) => {
      const source = readFileSync(path, "utf8");
      if (REPLACED.has(path)) return { contents: REPLACED.get(path) };
      if (!path.endsWith(".glsl.js")) {
        return { contents: (EMPTIED.get(path) ?? []).reduce(empty, source).replace(JSON_METHODS, "\n") };
      }
      if (UNUSED_SHADERS.includes(path)) {
        return { contents: 'export const vertex = "";\nexport const fragment = "";\n' };
      }
      const contents = source.replace(/\/\* glsl \*\/\s*`([^]*?)`/g, (_, glsl) => `\`${reduce(glsl)}\``);
      return { contents };
    });
  },
};

/** Empty a function with a name inside of another one. */
function empty(source, name) {
  const pattern = new RegExp(`^(\\t+)((?:async )?function ${name}|this\\.${name} = (?:async )?function )\\([^]*?^\\1}`, "m");
  if (!pattern.test(source)) throw new Error(`three.js has no function ${name}; adapt three_subset.mjs to this version`);
  return source.replace(pattern, "$1$2() {}");
}

/** Remove comments, indentation and the code of unused features from a shader. */
function reduce(glsl) {
  const code = glsl.replace(/\/\*[^]*?\*\//g, "").replace(/\/\/.*/g, "").replace(UNUSED_FUNCTIONS, "");
  const lines = code.split("\n");
  return removeUnused(lines.map((line) => line.trim()).filter(Boolean)).join("\n");
}

/** Whether a condition is that of an unused feature. */
function isUnused(directive, condition) {
  if (UNUSED_LIGHTS.test(condition)) return true;
  const pattern = directive.endsWith("def") ? /^(\w+)$/ : /^defined\s*\(\s*(\w+)\s*\)$/;
  return UNUSED.has(pattern.exec(condition)?.[1]);
}

/** Evaluate conditions of unused features; others stay. */
function removeUnused(lines) {
  const kept = [];
  /** Open conditions: whether their directives are removed, and whether their current branch stays. */
  const open = [];
  const isKept = () => open.every((one) => one.keeps);
  for (const line of lines) {
    const [, directive, condition] = /^#\s*(ifdef|ifndef|if|elif|else|endif)\b\s*(.*)$/.exec(line) ?? [];
    const top = open.at(-1);
    if (directive?.startsWith("if")) {
      const isRemoved = isUnused(directive, condition);
      if (!isRemoved && isKept()) kept.push(line);
      open.push({ isRemoved, keeps: !isRemoved || directive === "ifndef" });
    } else if (directive === "endif") {
      open.pop();
      if (!top.isRemoved && isKept()) kept.push(line);
    } else if (directive === "elif" && isUnused(directive, condition)) {
      if (!top.isRemoved) top.keeps = false;
    } else if (directive === "elif" && top.isRemoved) {
      if (top.keeps) throw new Error(`cannot remove the condition before ${line}`);
      Object.assign(top, { isRemoved: false, keeps: true }); // the first branch that stays
      if (isKept()) kept.push(`#if ${condition}`);
    } else if (directive && top.isRemoved) {
      top.keeps = !top.keeps;
    } else if (directive) {
      top.keeps = true;
      if (isKept()) kept.push(line);
    } else if (isKept()) kept.push(line);
  }
  if (open.length) throw new Error("a condition of a shader is not closed");
  return kept;
}
