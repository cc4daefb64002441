// Tables for physically based lighting, which shaders compute once: the environment filtered for
// every roughness, and the directional albedo of rough surfaces. After PMREMGenerator of three.js.

import { Program } from "./programs.js";
import { DataTexture, FloatType, LinearFilter, LinearMipmapLinearFilter, Texture } from "./textures.js";
import type { GpuTextures } from "./gpu_textures.js";

/** Width of the sides of an environment with roughness 0 and 1, in pixels. */
const [MIN_SIZE, SIZE_OF_ROUGHEST] = [256, 8];

/** Size of the table of directional albedos. */
const DFG_SIZE = 16;

/** Right, up and forward on the sides of a cube, as WebGL orders them. */
const SIDES = [
  { right: [0, 0, -1], up: [0, -1, 0], forward: [1, 0, 0] },
  { right: [0, 0, 1], up: [0, -1, 0], forward: [-1, 0, 0] },
  { right: [1, 0, 0], up: [0, 0, 1], forward: [0, 1, 0] },
  { right: [1, 0, 0], up: [0, 0, -1], forward: [0, -1, 0] },
  { right: [1, 0, 0], up: [0, -1, 0], forward: [0, 0, 1] },
  { right: [-1, 0, 0], up: [0, -1, 0], forward: [0, 0, -1] },
];

/** A triangle that covers the target; `at` is -1 to 1. */
export const FULL_SCREEN = `
out vec2 at;
void main() {
  at = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
  gl_Position = vec4(at, 0.0, 1.0);
}`;

const HEAD = `
precision highp float;
precision highp samplerCube;
#define PI 3.141592653589793
#define N_SAMPLES 256u
in vec2 at;
out vec4 result;
uniform vec3 right;
uniform vec3 up;
uniform vec3 forward;
uniform float roughness;
uniform float lodBias;
uniform sampler2D panorama;
uniform samplerCube source;

vec2 sampleAt(uint i) {
  uint bits = (i << 16u) | (i >> 16u);
  bits = ((bits & 0x55555555u) << 1u) | ((bits & 0xAAAAAAAAu) >> 1u);
  bits = ((bits & 0x33333333u) << 2u) | ((bits & 0xCCCCCCCCu) >> 2u);
  bits = ((bits & 0x0F0F0F0Fu) << 4u) | ((bits & 0xF0F0F0F0u) >> 4u);
  bits = ((bits & 0x00FF00FFu) << 8u) | ((bits & 0xFF00FF00u) >> 8u);
  return vec2(float(i) / float(N_SAMPLES), float(bits) * 2.3283064365386963e-10);
}`;

const PANORAMA_TO_CUBE = `${HEAD}
vec3 colorAt(vec3 direction) {
  vec3 d = normalize(direction);
  vec2 place = vec2(atan(d.z, d.x) / (2.0 * PI), asin(clamp(d.y, -1.0, 1.0)) / PI) + 0.5;
  return textureLod(panorama, place, 0.0).rgb;
}
void main() {
  vec3 direction = normalize(right * at.x + up * at.y + forward);
  vec3 dx = dFdx(direction) * 0.25;
  vec3 dy = dFdy(direction) * 0.25;
  result = vec4(colorAt(direction - dx - dy) + colorAt(direction + dx - dy)
    + colorAt(direction - dx + dy) + colorAt(direction + dx + dy), 4.0) * 0.25;
}`;

// Samples directions of light by the distribution of facets, for a viewer in the direction of the
// normal, from a level of the source that matches the solid angle of a sample.
const FILTER = `${HEAD}
void main() {
  vec3 n = normalize(right * at.x + up * at.y + forward);
  if (roughness == 0.0) {
    result = textureLod(source, n, 0.0);
    return;
  }
  float alpha = roughness * roughness;
  float alpha2 = alpha * alpha;
  vec3 t = normalize(cross(abs(n.z) < 0.999 ? vec3(0.0, 0.0, 1.0) : vec3(1.0, 0.0, 0.0), n));
  vec3 b = cross(n, t);
  result = vec4(0.0);
  for (uint i = 0u; i < N_SAMPLES; i++) {
    vec2 xi = sampleAt(i);
    float scale = 1.0 / (1.0 - xi.x + alpha2 * xi.x);
    float nl = (1.0 - xi.x - alpha2 * xi.x) * scale;
    if (nl <= 0.0) continue;
    float side = 2.0 * alpha * sqrt(xi.x * (1.0 - xi.x)) * scale;
    vec3 l = n * nl + (t * cos(2.0 * PI * xi.y) + b * sin(2.0 * PI * xi.y)) * side;
    result += vec4(textureLod(source, l, max(log2(alpha2 * scale) + lodBias, 0.0)).rgb, 1.0) * nl;
  }
  result /= result.a;
}`;

// The light that a surface reflects of uniform light, as a factor of the color at normal incidence
// and a constant. Columns have a roughness, rows a cosine between normal and viewer.
const DFG_TABLE = `${HEAD}
void main() {
  vec2 place = at * 0.5 + 0.5;
  float alpha2 = pow(place.x, 4.0);
  vec3 v = vec3(sqrt(1.0 - place.y * place.y), 0.0, place.y);
  vec2 sum = vec2(0.0);
  for (uint i = 0u; i < N_SAMPLES; i++) {
    vec2 xi = sampleAt(i);
    float nh = sqrt((1.0 - xi.x) / (1.0 + (alpha2 - 1.0) * xi.x));
    float side = sqrt(1.0 - nh * nh);
    vec3 h = vec3(side * cos(2.0 * PI * xi.y), side * sin(2.0 * PI * xi.y), nh);
    float vh = max(dot(v, h), 0.0);
    float nl = 2.0 * vh * h.z - v.z;
    if (nl <= 0.0) continue;
    float toViewer = nl * sqrt(alpha2 + (1.0 - alpha2) * v.z * v.z);
    float toLight = v.z * sqrt(alpha2 + (1.0 - alpha2) * nl * nl);
    float weight = 2.0 * nl * vh / ((toViewer + toLight) * nh);
    float fresnel = pow(1.0 - vh, 5.0);
    sum += vec2(1.0 - fresnel, fresnel) * weight;
  }
  result = vec4(sum / float(N_SAMPLES), 0.0, 1.0);
}`;

/** An environment on the GPU. */
export interface FilteredEnvironment {
  readonly texture: Texture;
  /** Level with roughness 1. */
  readonly maxLod: number;
}

/** Filter a panorama; the caller disposes of the result. */
export function filterEnvironment(
  gl: WebGL2RenderingContext,
  textures: GpuTextures,
  panorama: Texture,
): FilteredEnvironment {
  const { width } = panorama.image as { width: number };
  const maxLevel = Math.max(Math.floor(Math.log2(width / 4)), Math.log2(MIN_SIZE));
  const maxLod = maxLevel - Math.log2(SIZE_OF_ROUGHEST);
  const size = 2 ** maxLevel;
  const [source, texture] = [maxLevel, maxLod].map((lastLevel) => {
    const cube = new Texture();
    textures.bindNew(cube, gl.TEXTURE_CUBE_MAP);
    gl.texStorage2D(gl.TEXTURE_CUBE_MAP, lastLevel + 1, gl.RGBA16F, size, size);
    gl.texParameteri(gl.TEXTURE_CUBE_MAP, gl.TEXTURE_MIN_FILTER, LinearMipmapLinearFilter);
    gl.texParameteri(gl.TEXTURE_CUBE_MAP, gl.TEXTURE_MAG_FILTER, LinearFilter);
    return cube;
  });
  const fill = (program: Program, into: Texture, level: number, values: object) => {
    SIDES.forEach((axes, i) => {
      drawTo(gl, textures, into, gl.TEXTURE_CUBE_MAP_POSITIVE_X + i, level, size >> level, () => {
        program.use({ panorama, source, ...axes, ...values }, (one, unit) => textures.bind(one, unit));
      });
    });
  };
  const [project, filter] = [PANORAMA_TO_CUBE, FILTER].map((shader) => new Program(gl, FULL_SCREEN, shader));
  fill(project, source, 0, {});
  textures.bind(source);
  gl.generateMipmap(gl.TEXTURE_CUBE_MAP);
  for (let level = 0; level <= maxLod; level++) {
    const roughness = 1 - Math.sqrt(1 - level / maxLod);
    const lodBias = maxLevel + 0.5 * Math.log2(6 / (256 * roughness ** 4)) + 0.5;
    fill(filter, texture, level, { roughness, lodBias: roughness ? lodBias : 0 });
  }
  for (const program of [project, filter]) gl.deleteProgram(program.handle);
  source.dispose();
  return { texture, maxLod };
}

/** Compute the table of directional albedos; the caller disposes of it. */
export function createDfgTable(gl: WebGL2RenderingContext, textures: GpuTextures): Texture {
  const table = new DataTexture(null, DFG_SIZE, DFG_SIZE);
  table.minFilter = table.magFilter = LinearFilter;
  Object.assign(table, { type: FloatType, internalFormat: "RGBA16F", version: 1 });
  textures.bind(table);
  const program = new Program(gl, FULL_SCREEN, DFG_TABLE);
  drawTo(gl, textures, table, gl.TEXTURE_2D, 0, DFG_SIZE, () => program.use({}, () => {}));
  gl.deleteProgram(program.handle);
  return table;
}

/** Draw a full-screen triangle to a level of a texture. */
function drawTo(
  gl: WebGL2RenderingContext,
  textures: GpuTextures,
  texture: Texture,
  target: number,
  level: number,
  size: number,
  useProgram: () => void,
): void {
  const framebuffer = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
  const handle = textures.handleOf(texture) as WebGLTexture;
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, target, handle, level);
  gl.viewport(0, 0, size, size);
  for (const state of [gl.DEPTH_TEST, gl.BLEND, gl.CULL_FACE, gl.SCISSOR_TEST]) gl.disable(state);
  useProgram();
  gl.drawArrays(gl.TRIANGLES, 0, 3);
  gl.deleteFramebuffer(framebuffer);
}
