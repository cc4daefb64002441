// Reads back the output of vertex shaders that play PCA textures.
import { FloatType, NearestFilter, NoToneMapping, OrthographicCamera, Points, Scene, WebGLRenderer, WebGLRenderTarget } from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { loadPcaTexture, playPcaTexture } from "/meshreel_pca.js";

const COLUMNS = 64;

/** Positions and normals computed by the shader of three.js, four numbers per vertex, frame by frame. */
window.readThree = async (frames) => {
  const { scene: model } = await new GLTFLoader().loadAsync("/walk.glb");
  const mesh = model.getObjectByProperty("isMesh", true);
  const frame = playPcaTexture(mesh, await loadPcaTexture("/walk.png"));
  const { geometry, material } = mesh;
  const n = geometry.getAttribute("position").count;
  const rows = Math.ceil(n / COLUMNS);
  const told = { value: 0 };
  const compile = material.onBeforeCompile;
  material.onBeforeCompile = (shader) => {
    compile(shader);
    shader.uniforms.told = told;
    shader.vertexShader = shader.vertexShader
      .replace("#include <common>", "uniform float told;\nvarying vec3 seen;\n#include <common>")
      .replace(
        "#include <fog_vertex>",
        `#include <fog_vertex>
        seen = told < 0.5 ? transformed : objectNormal;
        vec2 pixel = vec2(gl_VertexID % ${COLUMNS}, gl_VertexID / ${COLUMNS}) + 0.5;
        gl_Position = vec4(2.0 * pixel / vec2(${COLUMNS}.0, ${rows}.0) - 1.0, 0.0, 1.0);
        gl_PointSize = 1.0;`,
      );
    shader.fragmentShader = "varying vec3 seen;\nvoid main() { gl_FragColor = vec4(seen, 1.0); }";
  };
  const renderer = new WebGLRenderer();
  renderer.toneMapping = NoToneMapping;
  const target = new WebGLRenderTarget(COLUMNS, rows, {
    type: FloatType, minFilter: NearestFilter, magFilter: NearestFilter, depthBuffer: false,
  });
  const world = new Scene();
  const points = new Points(geometry, material);
  points.frustumCulled = false;
  world.add(points);
  renderer.setRenderTarget(target);
  const found = [];
  for (const number of frames) {
    for (told.value of [0, 1]) {
      frame.value = number;
      renderer.render(world, new OrthographicCamera());
      const read = new Float32Array(4 * COLUMNS * rows);
      renderer.readRenderTargetPixels(target, 0, 0, COLUMNS, rows, read);
      found.push(Array.from(read.subarray(0, 4 * n)));
    }
  }
  renderer.dispose();
  return found;
};

const bitmapOf = async (url) =>
  createImageBitmap(await (await fetch(url)).blob(), {
    premultiplyAlpha: "none",
    colorSpaceConversion: "none",
  });

/** The outputs of a vertex shader, captured by transform feedback, frame by frame. */
window.readShader = async ({ source, attributes, outputs, frames, n }) => {
  const gl = document.createElement("canvas").getContext("webgl2");
  const program = gl.createProgram();
  const own = "#version 300 es\nprecision highp float;\nout vec4 color;\nvoid main() { color = vec4(1.0); }";
  for (const [kind, text] of [[gl.VERTEX_SHADER, source], [gl.FRAGMENT_SHADER, own]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(program, shader);
  }
  gl.transformFeedbackVaryings(program, outputs, gl.INTERLEAVED_ATTRIBS);
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  gl.useProgram(program);
  gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, await bitmapOf("/walk.png"));
  for (const [name, values] of Object.entries(attributes)) {
    const place = gl.getAttribLocation(program, name);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(values), gl.STATIC_DRAW);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, values.length / n, gl.FLOAT, false, 0, 0);
  }
  const block = gl.createBuffer();
  gl.bindBufferBase(gl.UNIFORM_BUFFER, 0, block);
  const caught = gl.createBuffer();
  const size = 3 * outputs.length * n;
  gl.bindBuffer(gl.TRANSFORM_FEEDBACK_BUFFER, caught);
  gl.bufferData(gl.TRANSFORM_FEEDBACK_BUFFER, 4 * size, gl.STREAM_READ);
  gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, 0, caught);
  gl.enable(gl.RASTERIZER_DISCARD);
  return frames.map((number) => {
    gl.bindBuffer(gl.UNIFORM_BUFFER, block);
    gl.bufferData(gl.UNIFORM_BUFFER, new Float32Array([number, 0, 0, 0]), gl.DYNAMIC_DRAW);
    gl.beginTransformFeedback(gl.POINTS);
    gl.drawArrays(gl.POINTS, 0, n);
    gl.endTransformFeedback();
    const read = new Float32Array(size);
    gl.getBufferSubData(gl.TRANSFORM_FEEDBACK_BUFFER, 0, read);
    return Array.from(read);
  });
};
window.isReady = true;
