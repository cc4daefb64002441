// Computes attributes from textures by transform feedback into vertex buffers, so that every material
// of three.js works without changes to its shader.

import * as THREE from "three";

import type { AttributeSetup } from "../backend.js";
import { createTable, PRELUDE } from "./tables.js";

const TEXTURES = `
uniform sampler2D sums;
uniform usampler2D table;
vec3 sumOf(uint item) {
  return texelFetch(sums, texelOf(int(item)), 0).xyz;
}
uvec2 pairAt(int entry) {
  return texelFetch(table, texelOf(entry), 0).xy;
}`;

/** Computes attributes of a geometry. */
export class AttributePass {
  readonly #renderer: THREE.WebGLRenderer;
  readonly #nVerts: number;
  readonly #gl: WebGL2RenderingContext;
  readonly #program: WebGLProgram;
  readonly #table: THREE.DataTexture;
  /** Has no buffers: those of the attributes must not be bound elsewhere. */
  readonly #array: WebGLVertexArrayObject;
  readonly #feedback: WebGLTransformFeedback;
  readonly #buffers: readonly WebGLBuffer[];

  /** @throws Error if the driver rejects the program */
  constructor(
    renderer: THREE.WebGLRenderer,
    geometry: THREE.BufferGeometry,
    { nVerts, attributes, table, glsl }: AttributeSetup,
  ) {
    this.#renderer = renderer;
    this.#nVerts = nVerts;
    const gl = (this.#gl = renderer.getContext() as WebGL2RenderingContext);
    const names = attributes.map(([name]) => name);
    const program = (this.#program = linkProgram(gl, TEXTURES + glsl, names));
    renderer.state.useProgram(program);
    gl.uniform1i(gl.getUniformLocation(program, "table"), 1); // the other one is 0
    this.#table = createTable(table);
    renderer.initTexture(this.#table);
    this.#array = gl.createVertexArray();
    this.#feedback = gl.createTransformFeedback();
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, this.#feedback);
    const open = geometry as THREE.BufferGeometry<THREE.NormalOrGLBufferAttributes>;
    this.#buffers = attributes.map(([name, width], i) => {
      const buffer = gl.createBuffer();
      gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, i, buffer);
      gl.bufferData(gl.TRANSFORM_FEEDBACK_BUFFER, 4 * width * nVerts, gl.DYNAMIC_COPY);
      open.setAttribute(name, new THREE.GLBufferAttribute(buffer, gl.FLOAT, width, 4, nVerts));
      return buffer;
    });
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, null);
    gl.bindBuffer(gl.TRANSFORM_FEEDBACK_BUFFER, null);
  }

  /** Compute the attributes from a texture of sums; must not be called while the renderer is drawing. */
  run(sums: THREE.Texture): void {
    const [gl, { state, properties }] = [this.#gl, this.#renderer];
    state.useProgram(this.#program);
    [sums, this.#table].forEach((texture, unit) => {
      // Rendered to or initialized before, so that it exists.
      const { __webglTexture } = properties.get(texture) as { __webglTexture: WebGLTexture };
      state.bindTexture(gl.TEXTURE_2D, __webglTexture, gl.TEXTURE0 + unit);
    });
    const array = gl.getParameter(gl.VERTEX_ARRAY_BINDING) as WebGLVertexArrayObject | null;
    gl.bindVertexArray(this.#array);
    gl.bindBuffer(gl.ARRAY_BUFFER, null);
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
    this.#table.dispose();
    if (!gl.isProgram(this.#program)) return; // the context was lost, and may have been restored
    gl.deleteProgram(this.#program);
    gl.deleteVertexArray(this.#array);
    gl.deleteTransformFeedback(this.#feedback);
    for (const buffer of this.#buffers) gl.deleteBuffer(buffer);
  }
}

function linkProgram(gl: WebGL2RenderingContext, vertexShader: string, outputs: string[]): WebGLProgram {
  const program = gl.createProgram();
  const attach = (type: GLenum, source: string) => {
    const shader = gl.createShader(type) as WebGLShader;
    gl.shaderSource(shader, `#version 300 es${PRELUDE}${source}`);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
    gl.deleteShader(shader);
  };
  attach(gl.VERTEX_SHADER, vertexShader);
  attach(gl.FRAGMENT_SHADER, "void main() {}");
  gl.transformFeedbackVaryings(program, outputs, gl.SEPARATE_ATTRIBS);
  gl.linkProgram(program);
  if (gl.getProgramParameter(program, gl.LINK_STATUS)) return program;
  throw new Error(gl.getProgramInfoLog(program) ?? "");
}
