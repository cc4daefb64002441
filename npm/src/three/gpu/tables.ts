// Arrays as textures: entry i is the texel (i mod 2048, i div 2048).

import * as THREE from "three";

/** Width of tables of several rows, which every GPU supports: 2 to the power of this. */
const WIDTH_BITS = 11;
const MAX_WIDTH = 1 << WIDTH_BITS;

/** GLSL at the start of every shader; `texelOf` maps an entry to its texel. */
export const PRELUDE = `
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp usampler2D;
precision highp isampler2DArray;
ivec2 texelOf(int entry) {
  return ivec2(entry & ${MAX_WIDTH - 1}, entry >> ${WIDTH_BITS});
}
`;

/** Return the size of the texture of at least one entry. */
export function tableSize(nEntries: number): { width: number; height: number } {
  const width = Math.min(nEntries, MAX_WIDTH);
  return { width, height: Math.ceil(nEntries / width) };
}

/** Create a texture of entries that are four floats, or two integers. */
export function createTable(data: Float32Array | Uint32Array): THREE.DataTexture {
  const isFloat = data instanceof Float32Array;
  const nNumbers = isFloat ? 4 : 2;
  const { width, height } = tableSize(data.length / nNumbers);
  const padded = new (isFloat ? Float32Array : Uint32Array)(width * height * nNumbers);
  padded.set(data);
  const texture = new THREE.DataTexture(padded, width, height);
  texture.type = THREE.FloatType;
  if (!isFloat) {
    texture.type = THREE.UnsignedIntType;
    texture.format = THREE.RGIntegerFormat;
    texture.internalFormat = "RG32UI"; // which older versions of three.js do not infer
  }
  texture.needsUpdate = true;
  return texture;
}

/** A uniform with a table of floats. */
export interface TableUniform {
  value: THREE.DataTexture | null;
}

/** Set the first entries of a table; replaces it if it is too small. */
export function setTable(uniform: TableUniform, data: Float32Array): void {
  const texture = uniform.value;
  const values = texture?.image.data as Float32Array | undefined;
  if (texture && values && values.length >= data.length) {
    values.set(data);
    texture.needsUpdate = true;
  } else {
    texture?.dispose();
    uniform.value = createTable(data);
  }
}
