// A mesh that is drawn: shaded faces, and its edges as lines over them. Its positions are a
// texture, so that the geometry is nothing but indices.

import * as THREE from "three";

import type { VertexGrid } from "./grid";
import type { NormalPass } from "./normals";
import { PAINT, type Paint } from "./paint";
import { PRECISION } from "./pass";

const surfaceVertex = (grid: VertexGrid) => `${grid.glsl}
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
uniform mat3 normalMatrix;
uniform sampler2D positions;
uniform sampler2D normals;
uniform sampler2D ownColors;
uniform sampler2D heat;
uniform bool isSmooth;
uniform int paintKind;
out vec3 place;
out vec3 normal;
out vec3 own;
out float value;
void main() {
  ivec2 texel = texelOf(gl_VertexID);
  vec4 seen = modelViewMatrix * vec4(texelFetch(positions, texel, 0).xyz, 1.0);
  place = seen.xyz;
  normal = isSmooth ? normalMatrix * texelFetch(normals, texel, 0).xyz : vec3(0.0);
  own = paintKind == 1 ? texelFetch(ownColors, texel, 0).rgb : vec3(0.0);
  value = paintKind == 2 ? texelFetch(heat, texel, 0).r : 0.0;
  gl_Position = projectionMatrix * seen;
}`;

// Faces are lit from both sides, whatever way they are wound. Heat is hardly lit, so that a colour
// stays the one of the bar and a fold is not taken for an error.
const SURFACE = `${PAINT}
uniform bool isSmooth;
in vec3 place;
in vec3 normal;
in vec3 own;
in float value;
out vec4 color;
void main() {
  vec3 flatNormal = normalize(cross(dFdx(place), dFdy(place)));
  vec3 n = isSmooth ? normalize(normal) : flatNormal;
  if (dot(n, flatNormal) < 0.0) n = -n;
  float key = max(dot(n, normalize(vec3(-0.45, 0.65, 0.62))), 0.0);
  float fill = max(dot(n, normalize(vec3(0.7, 0.1, 0.7))), 0.0);
  float sky = 0.5 + 0.5 * n.y;
  float light = paintKind == 2 ? 0.92 + 0.08 * key
                               : 0.30 + 0.52 * key + 0.16 * fill + 0.14 * sky;
  color = vec4(paint(own, value) * light, 1.0);
}`;

// Lines are drawn nearer to the eye by "lift": faces that they lie in do not hide them in part.
const lineVertex = (grid: VertexGrid) => `${grid.glsl}
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
uniform sampler2D positions;
uniform float lift;
void main() {
  vec4 seen = modelViewMatrix * vec4(texelFetch(positions, texelOf(gl_VertexID), 0).xyz, 1.0);
  seen.xyz *= 1.0 - min(lift / max(length(seen.xyz), 1e-30), 0.5);
  gl_Position = projectionMatrix * seen;
}`;

const LINE = `
uniform vec4 ink;
out vec4 color;
void main() { color = vec4(ink.rgb * ink.a, ink.a); }`;

export class Surface {
  readonly group = new THREE.Group();
  readonly faces: THREE.Mesh<THREE.BufferGeometry, THREE.RawShaderMaterial>;
  readonly lines: THREE.LineSegments<THREE.BufferGeometry, THREE.RawShaderMaterial>;
  private normalTarget: THREE.WebGLRenderTarget | null = null;
  private isStale = true;

  constructor(
    private readonly positions: THREE.Texture,
    grid: VertexGrid,
    index: THREE.BufferAttribute,
    paint: Paint["uniforms"],
  ) {
    const material = new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3,
      vertexShader: PRECISION + surfaceVertex(grid),
      fragmentShader: PRECISION + SURFACE,
      side: THREE.DoubleSide,
      polygonOffset: true,
      polygonOffsetFactor: 1,
      polygonOffsetUnits: 1,
      uniforms: {
        ...paint,
        positions: { value: positions },
        normals: { value: positions },
        isSmooth: { value: false },
      },
    });
    this.faces = new THREE.Mesh(new THREE.BufferGeometry().setIndex(index), material);
    this.lines = new THREE.LineSegments(
      new THREE.BufferGeometry(),
      new THREE.RawShaderMaterial({
        glslVersion: THREE.GLSL3,
        vertexShader: PRECISION + lineVertex(grid),
        fragmentShader: PRECISION + LINE,
        uniforms: {
          positions: { value: positions },
          ink: { value: new THREE.Vector4() },
          lift: { value: 0 },
        },
        depthWrite: false,
        transparent: true,
        premultipliedAlpha: true,
      }),
    );
    this.lines.visible = false;
    this.lines.renderOrder = 1;
    for (const part of [this.faces, this.lines]) {
      part.frustumCulled = false;
      this.group.add(part);
    }
  }

  /** Has the changed positions drawn. */
  moved(): void {
    this.isStale = true;
  }

  /** Shades smoothly with these normals, or flat without. */
  shade(renderer: THREE.WebGLRenderer, normals: NormalPass | null): void {
    const { uniforms } = this.faces.material;
    uniforms.isSmooth.value = normals !== null;
    if (!normals || !this.isStale) return;
    this.normalTarget ??= normals.target();
    normals.run(renderer, this.positions, this.normalTarget);
    uniforms.normals.value = this.normalTarget.texture;
    this.isStale = false;
  }
}

/** Each edge of the faces once, as pairs of vertices. */
export function edgesOf(faces: Uint32Array, nVerts: number): Uint32Array {
  const keys = new Float64Array(faces.length);
  for (let i = 0; i < faces.length; i++) {
    const a = faces[i];
    const b = faces[i % 3 === 2 ? i - 2 : i + 1];
    keys[i] = Math.min(a, b) * nVerts + Math.max(a, b);
  }
  keys.sort();
  const edges = [];
  for (let i = 0; i < keys.length; i++) {
    if (i === 0 || keys[i] !== keys[i - 1])
      edges.push(Math.floor(keys[i] / nVerts), keys[i] % nVerts);
  }
  return Uint32Array.from(edges);
}
