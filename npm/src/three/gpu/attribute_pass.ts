// Computes attributes from textures by transform feedback into vertex buffers, so that every material
// of three.js works without changes to its shader.

import * as THREE from "three";

import { PRECISION } from "./vertex_grid.js";

/** Computes attributes of a geometry from textures. */
export interface AttributeShader {
  /** Names of the textures. */
  readonly textures: readonly string[];
  /** Names of the inputs: one unsigned integer per vertex. */
  readonly inputs: readonly string[];
  /** Names and widths of the attributes. */
  readonly attributes: readonly (readonly [name: string, width: 2 | 3])[];
  /** GLSL that declares the textures, and whose function `main` sets the attributes. */
  readonly glsl: string;
}

const vertexShader = ({ inputs, attributes, glsl }: AttributeShader) =>
  `#version 300 es
${PRECISION}${inputs.map((name, i) => `layout(location = ${i}) in uint ${name};`).join("")}
${attributes.map(([name, width]) => `out vec${width} ${name};`).join("")}
${glsl}`;

const FRAGMENT = `#version 300 es
${PRECISION}
out vec4 color;
void main() { color = vec4(0.0); }`;

/** Computes attributes of a geometry. */
export class AttributePass {
  readonly #renderer: THREE.WebGLRenderer;
  readonly #nVerts: number;
  readonly #gl: WebGL2RenderingContext;
  readonly #program: WebGLProgram;
  readonly #array: WebGLVertexArrayObject;
  readonly #feedback: WebGLTransformFeedback;
  readonly #inputs: readonly WebGLBuffer[];
  readonly #buffers: readonly WebGLBuffer[];

  /**
   * @param shader - the attributes to add to the geometry
   * @param inputs - numbers of each vertex, by input of the shader
   * @throws Error if the driver rejects the program
   */
  constructor(
    renderer: THREE.WebGLRenderer,
    geometry: THREE.BufferGeometry,
    shader: AttributeShader,
    inputs: readonly Uint32Array[],
  ) {
    this.#renderer = renderer;
    const nVerts = (this.#nVerts = inputs[0].length);
    const gl = (this.#gl = renderer.getContext() as WebGL2RenderingContext);
    const { textures, attributes } = shader;
    const names = attributes.map(([name]) => name);
    this.#program = linkProgram(gl, vertexShader(shader), names);
    renderer.state.useProgram(this.#program);
    textures.forEach((name, i) => gl.uniform1i(gl.getUniformLocation(this.#program, name), i));
    this.#array = gl.createVertexArray();
    this.#inputs = inputs.map((numbers) => {
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
      gl.bufferData(gl.TRANSFORM_FEEDBACK_BUFFER, 4 * width * nVerts, gl.DYNAMIC_COPY);
      const attribute = new THREE.GLBufferAttribute(buffer, gl.FLOAT, width, 4, nVerts);
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
    gl.drawArrays(gl.POINTS, 0, this.#nVerts);
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

/** Return the WebGL texture of a three.js texture that has been rendered to or initialized. */
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
