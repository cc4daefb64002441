// The shader of surfaces. Its equations are those of three.js, so that the player and a page with
// three.js show the same: GGX with height-correlated Smith masking, and multiple scattering.

import type { Material, MeshBasicMaterial, MeshStandardMaterial } from "./materials.js";
import { Color } from "./math.js";
import type { Scene } from "./objects.js";
import type { UniformValues } from "./programs.js";
import type { Texture } from "./textures.js";

const SLOTS = ["map", "roughnessMap", "metalnessMap", "normalMap", "aoMap", "emissiveMap"] as const;

/** Color of the sky's light from below. */
const GROUND = new Color(0x8a8f98);

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
  vec3 light = base.rgb * occlusion();
  GLSL
  shown = vec4(toSrgb(light), base.a);
}`;

const SHADOW_MAIN = `
void main() {
  shown = vec4(baseColor().a * (1.0 - gl_FragCoord.z));
}`;

// The environment that metals reflect: a neutral studio, brighter at the top, with two area lights; angles
// in degrees. Roughness blurs it; diffuse light uses roughness 1.
const STUDIO = `
float coverage(float away, float halfSize, float blur) {
  return clamp((halfSize + blur - away) / (2.0 * blur), 0.0, min(halfSize / blur, 1.0));
}
float areaLight(vec2 direction, vec2 center, vec2 halfSize, float blur) {
  vec2 away = abs(direction - center);
  return coverage(min(away.x, 360.0 - away.x), halfSize.x, blur) * coverage(away.y, halfSize.y, blur);
}
float studio(vec3 d, float rough) {
  vec2 direction = degrees(vec2(atan(d.z, d.x), asin(clamp(d.y, -1.0, 1.0))));
  float blur = 3.0 + 57.0 * rough * rough;
  float walls = 0.32 + (d.y > 0.0 ? 0.28 : -0.2) * sqrt(abs(d.y));
  return mix(walls, 0.34 + 0.19 * d.y, rough)
    + 2.4 * areaLight(direction, vec2(-130.0, 40.0), vec2(32.0, 18.0), blur)
    + 1.3 * areaLight(direction, vec2(-15.0, 15.0), vec2(14.0, 40.0), blur);
}`;

const STANDARD_MAIN = `
uniform mat4 viewMatrix;
uniform vec3 emissive;
uniform float roughness;
uniform float metalness;
uniform vec2 normalScale;
uniform float keyIntensity;
uniform float skyIntensity;
uniform vec3 groundColor;

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
  vec3 matte = base.rgb * (1.0 - metal);
  vec3 f0 = mix(vec3(0.04), base.rgb, metal);
  vec3 v = normalize(-place);
  float nv = saturate(dot(n, v));
  vec2 dfg = albedo(rough, nv);

  // The lights that move with the camera: the key, and unless the studio lights the model, a rim light
  // from behind.
  vec3 lost = 1.0 + f0 * (1.0 / (dfg.x + dfg.y) - 1.0);
  float alpha2 = pow2(pow2(rough));
  vec3 light = vec3(0.0);
  for (int i = 0; i < 2; i++) {
    vec3 l = normalize(i == 0 ? vec3(-1.2, 1.4, 2.0) : vec3(1.6, 0.6, -0.8));
    vec3 h = normalize(l + v);
    float nl = saturate(dot(n, l));
    float vh = saturate(dot(v, h));
    float toViewer = nl * sqrt(alpha2 + (1.0 - alpha2) * nv * nv);
    float toLight = nv * sqrt(alpha2 + (1.0 - alpha2) * nl * nl);
    float visible = 0.5 / max(toViewer + toLight, 1e-6);
    float facets = alpha2 / (PI * pow2(pow2(saturate(dot(n, h))) * (alpha2 - 1.0) + 1.0));
    float fresnel = exp2((-5.55473 * vh - 6.98316) * vh);
    vec3 shine = (f0 * (1.0 - fresnel) + fresnel) * visible * facets * lost;
    light += (i == 0 ? keyIntensity : skyIntensity) * nl * (shine + matte / PI * 0.96 * (1.0 - fresnel));
  }

  // The sky and the studio.
  vec3 single;
  vec3 multi;
  scatter(dfg, vec3(0.04), single, multi);
  vec3 scattered = matte * (1.0 - single - multi);
  float up = dot(n, viewMatrix[1].xyz) * 0.5 + 0.5;
  float ambient = occlusion();
  vec3 around = skyIntensity * mix(groundColor, vec3(1.0), up) / PI;
#ifdef STUDIO
  mat3 toWorld = transpose(mat3(viewMatrix));
  around += studio(toWorld * n, 1.0);
  vec3 r = toWorld * normalize(mix(reflect(-v, n), n, pow2(pow2(rough))));
  float radiance = studio(r, rough);
  vec3 metalSingle;
  vec3 metalMulti;
  scatter(dfg, base.rgb, metalSingle, metalMulti);
  vec3 mirrored = radiance * mix(single, metalSingle, metal) + mix(multi, metalMulti, metal) * around;
  light += mirrored * saturate(pow(nv + ambient, exp2(-16.0 * rough - 1.0)) - 1.0 + ambient);
#endif
  light += scattered * around * ambient;
#ifdef EMISSIVEMAP
  light += emissive * texture(emissiveMap, emissiveMapUv).rgb;
#else
  light += emissive;
#endif
  shown = vec4(toSrgb(light), base.a);
}`;

/** A material without its own shaders. */
export type Surface = Material & Partial<Omit<MeshStandardMaterial, keyof Material> & Pick<MeshBasicMaterial, "glsl">>;

/** Return the macros of a material, which together with its own GLSL identify its shader. */
export function surfaceMacros(surface: Surface, { hasStudio, isShadow }: Scene): string {
  const isStandard = "roughness" in surface;
  const names = [
    isShadow ? "SHADOW" : isStandard ? "STANDARD" : "BASIC",
    ...SLOTS.map((slot) => surface[slot] && `${slot.toUpperCase()} ${uvName(surface[slot])}`),
    surface.vertexColors && "COLOR",
    surface.alphaTest > 0 && "ALPHA_TEST",
    !surface.transparent && "OPAQUE",
    surface.flatShading && "FLAT",
    surface.side && "DOUBLE",
    isStandard && hasStudio && "STUDIO",
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
  const ofBasic = BASIC_MAIN.replace("GLSL", surface.glsl ?? "");
  const main = isShadow ? SHADOW_MAIN : "roughness" in surface ? STUDIO + STANDARD_MAIN : ofBasic;
  return [
    macros + VERTEX.replace("IN_OUT", inputs + matrices).replace("UVS", transforms),
    macros + BASE.replace("IN_OUT", samplers) + main,
  ];
}

/** Return the uniforms of a material. */
export function surfaceUniforms(surface: Surface, { keyIntensity, skyIntensity }: Scene): UniformValues {
  const matrices = SLOTS.map((slot) => {
    surface[slot]?.updateMatrix();
    return [`${slot}Matrix`, surface[slot]?.matrix];
  });
  const rest = { ...Object.fromEntries(matrices), diffuse: surface.color, groundColor: GROUND };
  return { ...(surface as object), keyIntensity, skyIntensity, ...rest };
}

function uvName({ channel }: Texture): string {
  return `uv${channel || ""}`;
}
