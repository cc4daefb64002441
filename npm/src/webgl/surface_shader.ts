// The shader of surfaces. Its equations are those of three.js with an environment map and the tone mapping of
// Khronos, so that materials look as in stock viewers of glTF.

import type { Material, MeshStandardMaterial } from "./materials.js";
import type { Scene } from "./objects.js";
import type { UniformValues } from "./programs.js";
import type { Texture } from "./textures.js";

const SLOTS = ["map", "roughnessMap", "metalnessMap", "normalMap", "aoMap", "emissiveMap"] as const;

const TO_SRGB = `
vec3 toSrgb(vec3 light) {
  vec3 isDark = vec3(lessThanEqual(light, vec3(0.0031308)));
  return mix(pow(light, vec3(0.41666)) * 1.055 - 0.055, light * 12.92, isDark);
}`;

const VERTEX = `
precision highp float;
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
in vec3 position;
in vec3 normal;
in vec4 color;
out vec3 place;
out vec3 bent;
out vec4 tint;
IN_OUT
void main() {
  vec4 seen = modelViewMatrix * vec4(position, 1.0);
  place = seen.xyz;
  bent = mat3(modelViewMatrix) * normal;
#ifdef COLOR
  tint = color;
#endif
  UVS
  gl_Position = projectionMatrix * seen;
}`;

const BASE = `
precision highp float;
#define PI 3.141592653589793
uniform vec3 diffuse;
uniform float opacity;
uniform float alphaTest;
uniform float aoMapIntensity;
in vec3 place;
in vec3 bent;
in vec4 tint;
out vec4 shown;
IN_OUT
${TO_SRGB}
vec4 baseColor() {
  vec4 base = vec4(diffuse, opacity);
#ifdef MAP
  base *= texture(map, mapUv);
#endif
#ifdef COLOR
  base *= tint;
#endif
#ifdef ALPHA_TEST
  if (base.a < alphaTest) discard;
#endif
#ifdef OPAQUE
  base.a = 1.0;
#endif
  return base;
}
float occlusion() {
#ifdef AOMAP
  return (texture(aoMap, aoMapUv).r - 1.0) * aoMapIntensity + 1.0;
#else
  return 1.0;
#endif
}`;

const BASIC_MAIN = `
void main() {
  vec4 base = baseColor();
  shown = vec4(toSrgb(base.rgb * occlusion()), base.a);
}`;

const SHADOW_MAIN = `
void main() {
  shown = vec4(baseColor().a * (1.0 - gl_FragCoord.z));
}`;

// The environment: a neutral studio around the camera, as in meshreel/rendering/studio.py; directions are in
// view space. Its walls are brighter at the top, with three area lights: above, on the right behind, and a
// window on the left. `rough` blurs it as the lobe of GGX does; diffuse light is a polynomial fitted to it.
const STUDIO = `
float areaLight(vec2 away, vec2 halfSize, float blur) {
  vec2 covered = clamp((halfSize + blur - abs(away)) / (2.0 * blur), vec2(0.0), min(halfSize / blur, 1.0));
  return covered.x * covered.y;
}
float diffuseLight(vec3 d) {
  return 0.829 + dot(d, vec3(0.124, 0.525, 0.091)) + dot(d.xyx * d.yzz, vec3(-0.098, 0.201, -0.567))
    + 0.073 * (d.x * d.x - d.z * d.z);
}
float studioLight(vec3 d, float rough) {
  float blur = max(1.33 * rough - 0.085, 0.01);
  vec3 toWall = 1.0 / max(d, 0.001);
  float light = 0.14 + 0.44 * clamp(0.5 + d.y / max(2.0 * blur, 0.5), 0.0, 1.0)
    + step(0.0, d.y) * 5.0 * areaLight(d.xz * toWall.y - vec2(-0.8, 1.0), vec2(0.7, 0.6), blur)
    + step(0.0, d.x) * 6.0 * areaLight(d.yz * toWall.x - vec2(0.3, -0.6), vec2(0.8, 0.3), blur)
    + step(0.0, d.z) * 3.2 * areaLight(d.xy * toWall.z - vec2(-1.0, 0.25), vec2(0.3, 0.8), blur);
  return mix(light, diffuseLight(d), min(1.47 * rough * rough, 1.0));
}`;

const STANDARD_MAIN = `
uniform vec3 emissive;
uniform float roughness;
uniform float metalness;
uniform vec2 normalScale;

float pow2(float x) { return x * x; }
float saturate(float x) { return clamp(x, 0.0, 1.0); }

// The light that a surface reflects of uniform light, as a factor of the color at normal incidence and
// a constant; see https://www.unrealengine.com/en-US/blog/physically-based-shading-on-mobile
vec2 albedo(float rough, float nv) {
  vec4 r = rough * vec4(-1.0, -0.0275, -0.572, 0.022) + vec4(1.0, 0.0425, 1.04, -0.04);
  float a = min(r.x * r.x, exp2(-9.28 * nv)) * r.x + r.y;
  return vec2(-1.04, 1.04) * a + r.zw;
}

// Single and multiple scattering of a light from all directions.
void scatter(vec2 dfg, vec3 f0, out vec3 single, out vec3 multi) {
  single = f0 * dfg.x + dfg.y;
  float rest = 1.0 - dfg.x - dfg.y;
  vec3 mean = f0 + (1.0 - f0) / 21.0;
  multi = single * mean / (1.0 - rest * mean) * rest;
}

// Compress highlights and keep other colors: the tone mapping "PBR Neutral" of Khronos.
vec3 toneMapped(vec3 light) {
  float least = min(min(light.r, light.g), light.b);
  light -= least < 0.08 ? least - 6.25 * least * least : 0.04;
  float peak = max(max(light.r, light.g), light.b);
  if (peak < 0.76) return light;
  float mapped = 1.0 - 0.0576 / (peak - 0.52);
  return mix(vec3(mapped), light * mapped / peak, 1.0 / (0.15 * (peak - mapped) + 1.0));
}

void main() {
  vec4 base = baseColor();
  float face = gl_FrontFacing ? 1.0 : -1.0;
#ifdef FLAT
  vec3 n = normalize(cross(dFdx(place), dFdy(place)));
#else
  vec3 n = normalize(bent);
  #ifdef DOUBLE
  n *= face;
  #endif
#endif
#ifdef VALUES
  // Colors of values match the legend where they face the camera; others are darker, so that the form is visible.
  float relief = 0.62 + 0.38 * saturate(dot(n, vec3(-0.36, 0.54, 1.0)));
  shown = vec4(toSrgb(base.rgb * relief), base.a);
#else
  vec3 change = max(abs(dFdx(n)), abs(dFdy(n)));
#ifdef NORMALMAP
  // The directions of u and v on the surface; see http://www.thetenthplanet.de/archives/1180
  vec3 across = cross(dFdy(place), n);
  vec3 along = cross(n, dFdx(place));
  vec2 du = dFdx(normalMapUv);
  vec2 dv = dFdy(normalMapUv);
  vec3 t = across * du.x + along * dv.x;
  vec3 b = across * du.y + along * dv.y;
  float size = max(dot(t, t), dot(b, b));
  float scale = size == 0.0 ? 0.0 : inversesqrt(size);
  #ifdef DOUBLE
  scale *= face;
  #endif
  vec3 texel = texture(normalMap, normalMapUv).xyz * 2.0 - 1.0;
  n = normalize(mat3(t * scale, b * scale, n) * (texel * vec3(normalScale, 1.0)));
#endif
  float rough = roughness;
#ifdef ROUGHNESSMAP
  rough *= texture(roughnessMap, roughnessMapUv).g;
#endif
  float metal = metalness;
#ifdef METALNESSMAP
  metal *= texture(metalnessMap, metalnessMapUv).b;
#endif
  rough = min(max(rough, 0.045) + max(max(change.x, change.y), change.z), 1.0);
  vec3 v = normalize(-place);
  float nv = saturate(dot(n, v));
  vec2 dfg = albedo(rough, nv);

  // The reflections, and the diffuse light: what is not reflected.
  vec3 single;
  vec3 multi;
  vec3 metalSingle;
  vec3 metalMulti;
  scatter(dfg, vec3(0.04), single, multi);
  scatter(dfg, base.rgb, metalSingle, metalMulti);
  vec3 scattered = base.rgb * (1.0 - metal) * (1.0 - single - multi);
  float ambient = occlusion();
  float around = diffuseLight(n);
  float radiance = studioLight(normalize(mix(reflect(-v, n), n, pow2(pow2(rough)))), rough);
  vec3 mirrored = radiance * mix(single, metalSingle, metal) + mix(multi, metalMulti, metal) * around;
  vec3 light = mirrored * saturate(pow(nv + ambient, exp2(-16.0 * rough - 1.0)) - 1.0 + ambient);
  light += scattered * around * ambient;
#ifdef EMISSIVEMAP
  light += emissive * texture(emissiveMap, emissiveMapUv).rgb;
#else
  light += emissive;
#endif
  shown = vec4(toSrgb(toneMapped(light)), base.a);
#endif
}`;

/** A material without its own shaders. */
export type Surface = Material & Partial<Omit<MeshStandardMaterial, keyof Material>>;

/** Return the macros of a material, which identify its shader. */
export function surfaceMacros(surface: Surface, { isShadow }: Scene): string {
  const isStandard = "roughness" in surface;
  const names = [
    isShadow ? "SHADOW" : isStandard ? "STANDARD" : "BASIC",
    ...SLOTS.map((slot) => surface[slot] && `${slot.toUpperCase()} ${uvName(surface[slot])}`),
    surface.vertexColors && "COLOR",
    surface.alphaTest > 0 && "ALPHA_TEST",
    !surface.transparent && "OPAQUE",
    surface.flatShading && "FLAT",
    surface.side && "DOUBLE",
    surface.showsValues && "VALUES",
  ];
  return names.filter(Boolean).map((name) => `#define ${name}\n`).join("");
}

/** Return the vertex and the fragment shader of a material. */
export function surfaceShaders(surface: Surface, macros: string, { isShadow }: Scene): [string, string] {
  const slots = SLOTS.filter((slot) => surface[slot]);
  const channels = new Set(slots.map((slot) => uvName(surface[slot] as Texture)));
  const lines = (line: (slot: (typeof SLOTS)[number]) => string) => slots.map(line).join("\n");
  const inputs = [...channels].map((uv) => `in vec2 ${uv};\n`).join("");
  const matrices = lines((slot) => `uniform mat3 ${slot}Matrix;out vec2 ${slot}Uv;`);
  const transforms = lines((slot) => `${slot}Uv = (${slot}Matrix * vec3(${slot.toUpperCase()}, 1.0)).xy;`);
  const samplers = lines((slot) => `uniform sampler2D ${slot};in vec2 ${slot}Uv;`);
  const main = isShadow ? SHADOW_MAIN : "roughness" in surface ? STUDIO + STANDARD_MAIN : BASIC_MAIN;
  return [
    macros + VERTEX.replace("IN_OUT", inputs + matrices).replace("UVS", transforms),
    macros + BASE.replace("IN_OUT", samplers) + main,
  ];
}

/** Return the uniforms of a material. */
export function surfaceUniforms(surface: Surface): UniformValues {
  const matrices = SLOTS.map((slot) => {
    surface[slot]?.updateMatrix();
    return [`${slot}Matrix`, surface[slot]?.matrix];
  });
  return { ...(surface as object), ...Object.fromEntries(matrices), diffuse: surface.color };
}

function uvName({ channel }: Texture): string {
  return `uv${channel || ""}`;
}
