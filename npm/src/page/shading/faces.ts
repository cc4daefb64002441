// The default shading of faces: a plain color, or a heat map.

import { DoubleSide, GLSL3, RawShaderMaterial, Vector3 } from "../../webgl/index.js";

import { resolveColorMap } from "../../three/color/color_map.js";

/** The color map of heat maps, as in `meshreel render`. */
export const HEAT_COLORS = resolveColorMap("sequential");

const list = HEAT_COLORS.map((color) => `vec3(${color.map((c) => (c / 255).toFixed(5)).join(",")})`);

const VERTEX = `
precision highp float;
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
in vec3 position;
in vec3 normal;
in float heat;
out vec3 place;
out vec3 bent;
out float value;
void main() {
  vec4 seen = modelViewMatrix * vec4(position, 1.0);
  place = seen.xyz;
  bent = mat3(modelViewMatrix) * normal;
  value = heat;
  gl_Position = projectionMatrix * seen;
}`;

// Faces are lit from both sides, independent of their winding. Heat maps are lit weakly, so that the form
// is visible, but colors match the legend and folds do not look like errors. Negative values mean NaN, and are gray.
const FRAGMENT = `
precision highp float;
const vec3 HEAT[${HEAT_COLORS.length}] = vec3[${HEAT_COLORS.length}](${list.join(",")});
uniform bool isPainted;
uniform bool isSmooth;
uniform float heatMaximum;
uniform vec3 plain;
in vec3 place;
in vec3 bent;
in float value;
out vec4 color;
vec3 heatColor() {
  if (value < 0.0) return vec3(${(150 / 255).toFixed(5)});
  float at = clamp(value / heatMaximum, 0.0, 1.0) * ${(HEAT_COLORS.length - 1).toFixed(1)};
  int below = min(int(at), ${HEAT_COLORS.length - 2});
  return mix(HEAT[below], HEAT[below + 1], at - float(below));
}
void main() {
  vec3 flatNormal = normalize(cross(dFdx(place), dFdy(place)));
  vec3 n = isSmooth ? normalize(bent) : flatNormal;
  if (dot(n, flatNormal) < 0.0) n = -n;
  float key = max(dot(n, normalize(vec3(-0.45, 0.65, 0.62))), 0.0);
  float fill = max(dot(n, normalize(vec3(0.7, 0.1, 0.7))), 0.0);
  float sky = 0.5 + 0.5 * n.y;
  float light = isPainted ? 0.70 + 0.30 * key
                          : 0.30 + 0.52 * key + 0.16 * fill + 0.14 * sky;
  color = vec4((isPainted ? heatColor() : plain) * light, 1.0);
}`;

/** Moves faces slightly behind the lines drawn over them. */
export const POLYGON_OFFSET = {
  polygonOffset: true,
  polygonOffsetFactor: 1,
  polygonOffsetUnits: 1,
} as const;

/** A material that shows a plain color, or the attribute "heat" as a heat map. */
export class FaceMaterial extends RawShaderMaterial {
  constructor() {
    super({
      glslVersion: GLSL3,
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      side: DoubleSide,
      ...POLYGON_OFFSET,
      uniforms: {
        plain: { value: new Vector3(0.62, 0.69, 0.77) },
        heatMaximum: { value: 1 },
        isPainted: { value: false },
        isSmooth: { value: false },
      },
    });
  }

  set isSmooth(isSmooth: boolean) {
    this.uniforms.isSmooth.value = isSmooth;
  }

  /** Upper end of the heat map; null: plain color. */
  set heatMaximum(value: number | null) {
    this.uniforms.isPainted.value = value !== null;
    this.uniforms.heatMaximum.value = Math.max(value ?? 1, 1e-30);
  }
}
