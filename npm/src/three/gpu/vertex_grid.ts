// The layout of vertices in textures: vertex v is texel (v mod width, v div width).

import * as THREE from "three";

/** GLSL at the start of every shader. */
export const PRECISION = `
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp usampler2D;
precision highp isampler2DArray;
`;

/** The layout of a number of vertices. */
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

  /** GLSL function `texelOf`, which maps a vertex to its texel. */
  get glsl(): string {
    return `
ivec2 texelOf(int vertex) {
  return ivec2(vertex & ${this.width - 1}, vertex >> ${Math.log2(this.width)});
}`;
  }

  /** Create a render target with four floats per vertex. */
  target(): THREE.WebGLRenderTarget {
    return new THREE.WebGLRenderTarget(this.width, this.height, {
      type: THREE.FloatType,
      depthBuffer: false,
      minFilter: THREE.NearestFilter,
      magFilter: THREE.NearestFilter,
    });
  }
}

/** Create a data texture of 4 floats, or of 2 or 4 integers, for texelFetch. */
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
    // Older versions of three.js do not infer the internal format.
    texture.internalFormat = isPair ? "RG32UI" : "RGBA32UI";
  }
  texture.needsUpdate = true;
  return texture;
}
