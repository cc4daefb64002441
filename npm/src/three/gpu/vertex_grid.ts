// Vertices in textures: vertex v is the texel (v mod width, v div width) of each.

import * as THREE from "three";

/** GLSL that every shader here begins with. */
export const PRECISION = `
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp usampler2D;
precision highp isampler2DArray;
`;

/** The texels of the vertices of a mesh. */
export class VertexGrid {
  readonly width: number;
  readonly height: number;

  constructor(readonly nVerts: number) {
    this.width = 2 ** Math.ceil(Math.log2(Math.sqrt(nVerts)));
    this.height = Math.ceil(nVerts / this.width);
  }

  get nTexels(): number {
    return this.width * this.height;
  }

  /** GLSL: the texel of a vertex. */
  get glsl(): string {
    return this.glslOf("texelOf");
  }

  /** The same as a function of this name. */
  glslOf(name: string): string {
    return `
ivec2 ${name}(int vertex) {
  return ivec2(vertex & ${this.width - 1}, vertex >> ${Math.log2(this.width)});
}`;
  }

  /** A target whose texels are computed, four floats for each vertex. */
  target(): THREE.WebGLRenderTarget {
    return new THREE.WebGLRenderTarget(this.width, this.height, {
      type: THREE.FloatType,
      depthBuffer: false,
      minFilter: THREE.NearestFilter,
      magFilter: THREE.NearestFilter,
    });
  }
}

/** A texture of floats, or of 2 or 4 integers, that is fetched from texel by texel. */
export function dataTexture(
  data: Float32Array<ArrayBuffer> | Uint32Array<ArrayBuffer>,
  width: number,
  channels: 2 | 4 = 4,
): THREE.DataTexture {
  const isPair = channels === 2;
  const texture = new THREE.DataTexture(data, width, data.length / width / channels);
  texture.type = THREE.FloatType;
  if (data instanceof Uint32Array) {
    texture.type = THREE.UnsignedIntType;
    texture.format = isPair ? THREE.RGIntegerFormat : THREE.RGBAIntegerFormat;
    // Older versions of three.js do not know it from these.
    texture.internalFormat = isPair ? "RG32UI" : "RGBA32UI";
  }
  texture.needsUpdate = true;
  return texture;
}
