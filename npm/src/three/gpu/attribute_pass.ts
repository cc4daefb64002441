// Positions and normals from textures into buffers of vertices, as every material of three.js reads
// them: no shader of a page is changed. WebGL calls this transform feedback.

import * as THREE from "three";

import { PRECISION, type VertexGrid } from "./vertex_grid.js";

const vertexShader = (grid: VertexGrid) => `#version 300 es
${PRECISION}${grid.glsl}
uniform sampler2D positions;
uniform sampler2D normals;
layout(location = 0) in uint source;
out vec3 position;
out vec3 normal;
void main() {
  ivec2 texel = texelOf(int(source));
  position = texelFetch(positions, texel, 0).xyz;
  normal = texelFetch(normals, texel, 0).xyz;
}`;

const FRAGMENT = `#version 300 es
${PRECISION}
out vec4 color;
void main() { color = vec4(0.0); }`;

const NAMES = ["position", "normal"];

/** Copies what passes have computed into the attributes of a geometry. */
export class AttributePass {
  readonly #renderer: THREE.WebGLRenderer;
  readonly #sources: Uint32Array;
  readonly #gl: WebGL2RenderingContext;
  readonly #program: WebGLProgram;
  readonly #array: WebGLVertexArrayObject;
  readonly #feedback: WebGLTransformFeedback;
  readonly #source: WebGLBuffer;
  readonly #buffers: readonly WebGLBuffer[];

  /**
   * @param sources - the vertex, in the textures, of each vertex of the geometry
   * @throws Error if the driver refuses
   */
  constructor(
    renderer: THREE.WebGLRenderer,
    grid: VertexGrid,
    sources: Uint32Array,
    geometry: THREE.BufferGeometry,
  ) {
    this.#renderer = renderer;
    this.#sources = sources;
    const gl = (this.#gl = renderer.getContext() as WebGL2RenderingContext);
    this.#program = linked(gl, vertexShader(grid));
    renderer.state.useProgram(this.#program);
    gl.uniform1i(gl.getUniformLocation(this.#program, "normals"), 1);
    this.#array = gl.createVertexArray();
    this.#source = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.#source);
    gl.bufferData(gl.ARRAY_BUFFER, sources, gl.STATIC_DRAW);
    this.#feedback = gl.createTransformFeedback();
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, this.#feedback);
    const open = geometry as THREE.BufferGeometry<THREE.NormalOrGLBufferAttributes>;
    this.#buffers = NAMES.map((name, i) => {
      const buffer = gl.createBuffer();
      gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, i, buffer);
      gl.bufferData(gl.TRANSFORM_FEEDBACK_BUFFER, 12 * sources.length, gl.DYNAMIC_COPY);
      const attribute = new THREE.GLBufferAttribute(buffer, gl.FLOAT, 3, 4, sources.length);
      open.setAttribute(name, attribute);
      return buffer;
    });
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, null);
    gl.bindBuffer(gl.TRANSFORM_FEEDBACK_BUFFER, null);
  }

  /** Must not be called while the renderer draws something else. */
  run(...textures: [positions: THREE.Texture, normals: THREE.Texture]): void {
    const [gl, renderer] = [this.#gl, this.#renderer];
    renderer.state.useProgram(this.#program);
    textures.forEach((texture, slot) => {
      renderer.state.bindTexture(gl.TEXTURE_2D, handleOf(renderer, texture), gl.TEXTURE0 + slot);
    });
    const array = gl.getParameter(gl.VERTEX_ARRAY_BINDING) as WebGLVertexArrayObject | null;
    gl.bindVertexArray(this.#array);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.#source);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribIPointer(0, 1, gl.UNSIGNED_INT, 0, 0);
    gl.bindBuffer(gl.ARRAY_BUFFER, null); // what is written must not be bound elsewhere
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
    for (const buffer of [this.#source, ...this.#buffers]) gl.deleteBuffer(buffer);
  }
}

/** The texture of WebGL that one of three.js is, which has been drawn into. */
function handleOf(renderer: THREE.WebGLRenderer, texture: THREE.Texture): WebGLTexture {
  return (renderer.properties.get(texture) as { __webglTexture: WebGLTexture }).__webglTexture;
}

function linked(gl: WebGL2RenderingContext, vertexSource: string): WebGLProgram {
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
  gl.transformFeedbackVaryings(program, NAMES, gl.SEPARATE_ATTRIBS);
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) {
    throw new Error(gl.getProgramInfoLog(program) ?? "");
  }
  return program;
}
