// Positions and normals from textures into buffers of vertices, as every material of three.js reads
// them: no shader of a page is changed. WebGL calls this transform feedback.

import * as THREE from "three";

import { InvalidInputError } from "../../errors";
import { PRECISION, type VertexGrid } from "./vertex_grid";

const vertexShader = (grid: VertexGrid) => `#version 300 es
${PRECISION}${grid.glsl}
uniform sampler2D positions;
uniform sampler2D normals;
in uint source;
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

const NAMES = ["position", "normal"] as const;

/** Copies what passes have computed into the attributes of a geometry. */
export class AttributePass {
  private readonly gl: WebGL2RenderingContext;
  private readonly program: WebGLProgram;
  private readonly array: WebGLVertexArrayObject;
  private readonly feedback: WebGLTransformFeedback;
  private readonly buffers: WebGLBuffer[];

  /** @param sources - the vertex, in the textures, of each vertex of the geometry */
  constructor(
    private readonly renderer: THREE.WebGLRenderer,
    grid: VertexGrid,
    private readonly sources: Uint32Array,
    geometry: THREE.BufferGeometry,
  ) {
    const gl = (this.gl = renderer.getContext() as WebGL2RenderingContext);
    this.program = linked(gl, vertexShader(grid));
    this.buffers = [...NAMES, "source"].map(() => gl.createBuffer());
    this.array = gl.createVertexArray();
    this.feedback = gl.createTransformFeedback();
    this.fill();
    const open = geometry as THREE.BufferGeometry<THREE.NormalOrGLBufferAttributes>;
    NAMES.forEach((name, i) => {
      const buffer = this.buffers[i];
      const attribute = new THREE.GLBufferAttribute(buffer, gl.FLOAT, 3, 4, sources.length);
      open.setAttribute(name, attribute);
    });
  }

  /** Must not be called while the renderer draws something else. */
  run(positions: THREE.Texture, normals: THREE.Texture): void {
    const { gl, renderer } = this;
    const array = gl.getParameter(gl.VERTEX_ARRAY_BINDING) as WebGLVertexArrayObject | null;
    renderer.state.useProgram(this.program);
    [positions, normals].forEach((texture, slot) => {
      renderer.state.bindTexture(gl.TEXTURE_2D, handleOf(renderer, texture), gl.TEXTURE0 + slot);
    });
    gl.bindVertexArray(this.array);
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, this.feedback);
    gl.enable(gl.RASTERIZER_DISCARD);
    gl.beginTransformFeedback(gl.POINTS);
    gl.drawArrays(gl.POINTS, 0, this.sources.length);
    gl.endTransformFeedback();
    gl.disable(gl.RASTERIZER_DISCARD);
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, null);
    gl.bindVertexArray(array);
  }

  dispose(): void {
    const { gl } = this;
    gl.deleteProgram(this.program);
    gl.deleteVertexArray(this.array);
    gl.deleteTransformFeedback(this.feedback);
    for (const buffer of this.buffers) gl.deleteBuffer(buffer);
  }

  private fill(): void {
    const { gl, renderer, program, buffers, sources } = this;
    const array = gl.getParameter(gl.VERTEX_ARRAY_BINDING) as WebGLVertexArrayObject | null;
    gl.bindVertexArray(this.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers[NAMES.length]);
    gl.bufferData(gl.ARRAY_BUFFER, sources, gl.STATIC_DRAW);
    const place = gl.getAttribLocation(program, "source");
    gl.enableVertexAttribArray(place);
    gl.vertexAttribIPointer(place, 1, gl.UNSIGNED_INT, 0, 0);
    gl.bindVertexArray(array);
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, this.feedback);
    NAMES.forEach((_, i) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, buffers[i]);
      gl.bufferData(gl.ARRAY_BUFFER, 12 * sources.length, gl.DYNAMIC_COPY);
      gl.bindBuffer(gl.ARRAY_BUFFER, null);
      gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, i, buffers[i]);
    });
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, null);
    gl.bindBuffer(gl.TRANSFORM_FEEDBACK_BUFFER, null);
    renderer.state.useProgram(program);
    gl.uniform1i(gl.getUniformLocation(program, "positions"), 0);
    gl.uniform1i(gl.getUniformLocation(program, "normals"), 1);
  }
}

/** The texture of WebGL that one of three.js is, which has been drawn into. */
function handleOf(renderer: THREE.WebGLRenderer, texture: THREE.Texture): WebGLTexture {
  return (renderer.properties.get(texture) as { __webglTexture: WebGLTexture }).__webglTexture;
}

function linked(gl: WebGL2RenderingContext, vertexSource: string): WebGLProgram {
  const program = gl.createProgram();
  for (const [type, source] of [
    [gl.VERTEX_SHADER, vertexSource],
    [gl.FRAGMENT_SHADER, FRAGMENT],
  ] as const) {
    const shader = gl.createShader(type);
    if (!shader) continue; // the context is lost, and comes back
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
    gl.deleteShader(shader);
  }
  gl.transformFeedbackVaryings(program, NAMES as unknown as string[], gl.SEPARATE_ATTRIBS);
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
    throw new InvalidInputError(`this graphics card refuses: ${gl.getProgramInfoLog(program)}`);
  }
  return program;
}
