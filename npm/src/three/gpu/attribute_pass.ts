// Copies computed textures to vertex buffers by transform feedback, so that every material of
// three.js works without changes to its shader.

import * as THREE from "three";

import { PRECISION, type VertexGrid } from "./vertex_grid.js";

/** Computes attributes of a geometry from textures. */
export interface AttributeShader {
  /** Names of the textures. In GLSL, the variable of that name is the texel of the vertex, a vec3. */
  readonly textures: readonly string[];
  /** Names and widths of the attributes. */
  readonly attributes: readonly (readonly [name: string, width: 2 | 3])[];
  /** GLSL that sets the attributes. */
  readonly glsl: string;
}

export const POSITION_AND_NORMAL: AttributeShader = {
  textures: ["positions", "normals"],
  attributes: [
    ["position", 3],
    ["normal", 3],
  ],
  glsl: "position = positions; normal = normals;",
};

/** The texel of each vertex in all textures but the first. */
export interface Rows {
  readonly grid: VertexGrid;
  readonly numbers: Uint32Array;
}

const vertexShader = (
  grid: VertexGrid,
  rowGrid: VertexGrid,
  { textures, attributes, glsl }: AttributeShader,
) =>
  `#version 300 es
${PRECISION}${grid.glsl}${rowGrid.glslOf("rowTexelOf")}
${textures.map((name) => `uniform sampler2D ${name}Texels;`).join("")}
${attributes.map(([name, width]) => `out vec${width} ${name};`).join("")}
layout(location = 0) in uint source;
layout(location = 1) in uint row;
void main() {
  ivec2 texel = texelOf(int(source));
  ivec2 rowTexel = rowTexelOf(int(row));
  ${textures.map((name, i) => fetchTexel(name, i ? "rowTexel" : "texel")).join("")}
  ${glsl}
}`;

const fetchTexel = (name: string, texel: string) =>
  `vec3 ${name} = texelFetch(${name}Texels, ${texel}, 0).xyz;`;

const FRAGMENT = `#version 300 es
${PRECISION}
out vec4 color;
void main() { color = vec4(0.0); }`;

/** Copies computed textures to the attributes of a geometry. */
export class AttributePass {
  readonly #renderer: THREE.WebGLRenderer;
  readonly #sources: Uint32Array;
  readonly #gl: WebGL2RenderingContext;
  readonly #program: WebGLProgram;
  readonly #array: WebGLVertexArrayObject;
  readonly #feedback: WebGLTransformFeedback;
  /** Source and row of each vertex. */
  readonly #inputs: readonly WebGLBuffer[];
  readonly #buffers: readonly WebGLBuffer[];

  /**
   * @param sources - the texel of each vertex of the geometry
   * @param shader - the attributes to add to the geometry
   * @param rows - default: the sources
   * @throws Error if the driver rejects the program
   */
  constructor(
    renderer: THREE.WebGLRenderer,
    grid: VertexGrid,
    sources: Uint32Array,
    geometry: THREE.BufferGeometry,
    shader: AttributeShader,
    rows: Rows = { grid, numbers: sources },
  ) {
    this.#renderer = renderer;
    this.#sources = sources;
    const gl = (this.#gl = renderer.getContext() as WebGL2RenderingContext);
    const { textures, attributes } = shader;
    const names = attributes.map(([name]) => name);
    this.#program = linkProgram(gl, vertexShader(grid, rows.grid, shader), names);
    renderer.state.useProgram(this.#program);
    textures.forEach((name, i) => {
      gl.uniform1i(gl.getUniformLocation(this.#program, `${name}Texels`), i);
    });
    this.#array = gl.createVertexArray();
    this.#inputs = [sources, rows.numbers].map((numbers) => {
      const buffer = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, numbers, gl.STATIC_DRAW);
      return buffer;
    });
    this.#feedback = gl.createTransformFeedback();
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, this.#feedback);
    const open = geometry as THREE.BufferGeometry<THREE.NormalOrGLBufferAttributes>;
    this.#buffers = attributes.map(([name, width], i) => {
      const buffer = gl.createBuffer();
      gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, i, buffer);
      gl.bufferData(gl.TRANSFORM_FEEDBACK_BUFFER, 4 * width * sources.length, gl.DYNAMIC_COPY);
      const attribute = new THREE.GLBufferAttribute(buffer, gl.FLOAT, width, 4, sources.length);
      open.setAttribute(name, attribute);
      return buffer;
    });
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, null);
    gl.bindBuffer(gl.TRANSFORM_FEEDBACK_BUFFER, null);
  }

  /** Run the pass; must not be called while the renderer is drawing. */
  run(...textures: readonly THREE.Texture[]): void {
    const [gl, renderer] = [this.#gl, this.#renderer];
    renderer.state.useProgram(this.#program);
    textures.forEach((texture, slot) => {
      renderer.state.bindTexture(gl.TEXTURE_2D, webglTexture(renderer, texture), gl.TEXTURE0 + slot);
    });
    const array = gl.getParameter(gl.VERTEX_ARRAY_BINDING) as WebGLVertexArrayObject | null;
    gl.bindVertexArray(this.#array);
    this.#inputs.forEach((buffer, location) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.enableVertexAttribArray(location);
      gl.vertexAttribIPointer(location, 1, gl.UNSIGNED_INT, 0, 0);
    });
    gl.bindBuffer(gl.ARRAY_BUFFER, null); // output buffers must not be bound elsewhere
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, this.#feedback);
    gl.enable(gl.RASTERIZER_DISCARD);
    gl.beginTransformFeedback(gl.POINTS);
    gl.drawArrays(gl.POINTS, 0, this.#sources.length);
    gl.endTransformFeedback();
    gl.disable(gl.RASTERIZER_DISCARD);
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, null);
    gl.bindVertexArray(array);
  }

  dispose(): void {
    const gl = this.#gl;
    gl.deleteProgram(this.#program);
    gl.deleteVertexArray(this.#array);
    gl.deleteTransformFeedback(this.#feedback);
    for (const buffer of [...this.#inputs, ...this.#buffers]) gl.deleteBuffer(buffer);
  }
}

/** Return the WebGL texture of a three.js texture that has been rendered to. */
function webglTexture(renderer: THREE.WebGLRenderer, texture: THREE.Texture): WebGLTexture {
  return (renderer.properties.get(texture) as { __webglTexture: WebGLTexture }).__webglTexture;
}

function linkProgram(
  gl: WebGL2RenderingContext,
  vertexSource: string,
  names: readonly string[],
): WebGLProgram {
  const program = gl.createProgram();
  const attach = (type: GLenum, source: string) => {
    const shader = gl.createShader(type) as WebGLShader;
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
    gl.deleteShader(shader);
  };
  attach(gl.VERTEX_SHADER, vertexSource);
  attach(gl.FRAGMENT_SHADER, FRAGMENT);
  gl.transformFeedbackVaryings(program, names, gl.SEPARATE_ATTRIBS);
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) {
    throw new Error(gl.getProgramInfoLog(program) ?? "");
  }
  return program;
}
