// The colour of a vertex: plain, its own, or how far it is off. Drawing and reading back share it.

import * as THREE from "three";

import { HEAT } from "../heat_map";
import { texture, type VertexGrid } from "./grid";
import { Pass } from "./pass";

export const PLAIN = 0;
export const OWN_COLORS = 1;
export const HEAT_MAP = 2;

const list = HEAT.map((color) => `vec3(${color.map((c) => (c / 255).toFixed(5)).join(",")})`);

/** GLSL `paint(ownColor, value)`; a negative value is not a number, and grey. */
export const PAINT = `
const vec3 HEAT[${HEAT.length}] = vec3[${HEAT.length}](${list.join(",")});
uniform int paintKind;
uniform vec3 plain;
uniform float hottest;
vec3 heatColor(float value) {
  if (value < 0.0) return vec3(${(150 / 255).toFixed(5)});
  float place = clamp(value / hottest, 0.0, 1.0) * ${(HEAT.length - 1).toFixed(1)};
  int below = min(int(place), ${HEAT.length - 2});
  return mix(HEAT[below], HEAT[below + 1], place - float(below));
}
vec3 paint(vec3 own, float value) {
  return paintKind == ${HEAT_MAP} ? heatColor(value) : paintKind == ${OWN_COLORS} ? own : plain;
}`;

const READ_BACK = `${PAINT}
uniform sampler2D ownColors;
uniform sampler2D heat;
out vec4 color;
void main() {
  ivec2 texel = ivec2(gl_FragCoord.xy);
  color = vec4(paint(texelFetch(ownColors, texel, 0).rgb, texelFetch(heat, texel, 0).r), 1.0);
}`;

export class Paint {
  readonly uniforms;
  readonly hasOwnColors: boolean;
  private readonly heat: THREE.DataTexture;

  constructor(
    private readonly grid: VertexGrid,
    ownColors: Uint8Array | null,
  ) {
    this.heat = grid.floats(1);
    this.hasOwnColors = ownColors !== null;
    this.uniforms = {
      paintKind: { value: PLAIN },
      plain: { value: new THREE.Vector3(0.62, 0.69, 0.77) },
      hottest: { value: 1 },
      heat: { value: this.heat },
      ownColors: { value: colorTexture(grid, ownColors) },
    };
  }

  /** Values of the shown frame, and the value that is painted hottest. */
  setHeat(values: Float32Array, hottest: number): void {
    const data = this.heat.image.data as unknown as Float32Array;
    values.forEach((value, vertex) => (data[vertex] = Number.isNaN(value) ? -1 : value));
    this.heat.needsUpdate = true;
    this.uniforms.hottest.value = Math.max(hottest, 1e-30);
  }

  /** Colours (V, 3) of the vertices before any light falls on them, read back from the GPU. */
  read(renderer: THREE.WebGLRenderer): Uint8Array {
    const { width, height, nVerts } = this.grid;
    const target = this.grid.target(THREE.UnsignedByteType);
    new Pass(READ_BACK, this.uniforms).run(renderer, target);
    const texels = new Uint8Array(width * height * 4);
    renderer.readRenderTargetPixels(target, 0, 0, width, height, texels);
    target.dispose();
    return new Uint8Array(3 * nVerts).map((_, i) => texels[4 * Math.floor(i / 3) + (i % 3)]);
  }
}

function colorTexture(grid: VertexGrid, colors: Uint8Array | null): THREE.DataTexture {
  if (!colors) return texture(new Uint8Array(4), 1, 1, THREE.RGBAFormat, THREE.UnsignedByteType);
  const channels = colors.length / grid.nVerts;
  const data = new Uint8Array(grid.nTexels * 4).fill(255);
  for (let vertex = 0; vertex < grid.nVerts; vertex++) {
    data.set(colors.subarray(vertex * channels, vertex * channels + 3), 4 * vertex);
  }
  return texture(data, grid.width, grid.height, THREE.RGBAFormat, THREE.UnsignedByteType);
}
