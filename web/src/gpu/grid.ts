// Vertices in textures: vertex v is the texel (v mod width, v div width) of each.

import * as THREE from "three";

export class VertexGrid {
  readonly width: number;
  readonly height: number;

  constructor(readonly nVerts: number) {
    this.width = 2 ** Math.ceil(Math.log2(Math.sqrt(Math.max(1, nVerts))));
    this.height = Math.max(1, Math.ceil(nVerts / this.width));
  }

  get nTexels(): number {
    return this.width * this.height;
  }

  /** GLSL: the texel of a vertex. */
  get glsl(): string {
    return `ivec2 texelOf(int vertex) {
      return ivec2(vertex & ${this.width - 1}, vertex >> ${Math.log2(this.width)});
    }`;
  }

  /** A texture of floats that shaders fetch from; `channels` are 1 or 4. */
  floats(channels: 1 | 4): THREE.DataTexture {
    const format = channels === 1 ? THREE.RedFormat : THREE.RGBAFormat;
    const data = new Float32Array(this.nTexels * channels);
    return texture(data, this.width, this.height, format, THREE.FloatType);
  }

  /** A target whose texels are computed, one vertex each. */
  target(type: THREE.TextureDataType): THREE.WebGLRenderTarget {
    return new THREE.WebGLRenderTarget(this.width, this.height, {
      type,
      depthBuffer: false,
      minFilter: THREE.NearestFilter,
      magFilter: THREE.NearestFilter,
    });
  }
}

/** A texture that is fetched from texel by texel. */
export function texture(
  data: THREE.TypedArray,
  width: number,
  height: number,
  format: THREE.PixelFormat,
  type: THREE.TextureDataType,
): THREE.DataTexture {
  const made = new THREE.DataTexture(
    data as THREE.TypedArray & BufferSource,
    width,
    height,
    format,
    type,
  );
  made.unpackAlignment = 1;
  made.needsUpdate = true;
  return made;
}
