// Draws scenes with WebGL 2, with the part of the interface of three.js that `ReelMesh` and the
// player use. Scenes are small, so the state of the context is set for each object.

import { type BufferAttribute, type BufferGeometry, GLBufferAttribute } from "./geometry.js";
import { GpuTextures, onDispose } from "./gpu_textures.js";
import { DoubleSide, type Material, RawShaderMaterial } from "./materials.js";
import { Matrix4, Vector3 } from "./math.js";
import { type Camera, Mesh, type Object3D, type Scene } from "./objects.js";
import { Program, type UniformValues } from "./programs.js";
import { type Surface, surfaceMacros, surfaceShaders, surfaceUniforms } from "./surface_shader.js";
import type { Texture, WebGLRenderTarget } from "./textures.js";

/** A part of a mesh with one material. */
interface DrawItem {
  readonly mesh: Mesh;
  readonly material: Material;
  readonly start: number;
  readonly count: number;
  /** Distance from the camera, in arbitrary units. */
  readonly depth: number;
}

type Rectangle = [x: number, y: number, width: number, height: number];

/** Draws to a canvas or a render target. */
export class WebGLRenderer {
  readonly isWebGLRenderer = true;
  readonly domElement: HTMLCanvasElement;
  readonly xr = { enabled: false };
  readonly capabilities: { readonly maxTextureSize: number };
  readonly extensions = { has: (name: string): boolean => this.#gl.getExtension(name) !== null };
  readonly properties = { get: (texture: Texture) => ({ __webglTexture: this.#textures.handleOf(texture) }) };
  readonly state = {
    useProgram: (program: WebGLProgram): void => this.#gl.useProgram(program),
    bindTexture: (target: number, texture: WebGLTexture, unit: number): void => {
      this.#gl.activeTexture(unit);
      this.#gl.bindTexture(target, texture);
    },
  };
  readonly #gl: WebGL2RenderingContext;
  #textures!: GpuTextures;
  /** Programs by source, which most materials share; kept until the context is lost. */
  #programs!: Map<string, Program>;
  #buffers!: WeakMap<BufferAttribute, { readonly handle: WebGLBuffer; version: number }>;
  /** Geometries whose buffers are freed when they are disposed of. */
  #geometries!: WeakSet<BufferGeometry<any>>;
  #target: WebGLRenderTarget | null = null;
  #pixelRatio = 1;
  #viewport: Rectangle = [0, 0, 0, 0];
  #scissor: Rectangle | null = null;
  /** Must be requested before the context is lost. */
  readonly #loss: WEBGL_lose_context | null;
  readonly #onRestored = (): void => this.#initialize();

  /** @throws Error if there is no WebGL 2 */
  constructor({ canvas, ...attributes }: WebGLContextAttributes & { canvas: HTMLCanvasElement }) {
    this.domElement = canvas;
    const gl = canvas.getContext("webgl2", attributes);
    if (!gl) throw new Error("a WebGL 2 context could not be created");
    this.#gl = gl;
    this.#loss = gl.getExtension("WEBGL_lose_context");
    this.capabilities = { maxTextureSize: gl.getParameter(gl.MAX_TEXTURE_SIZE) as number };
    canvas.addEventListener("webglcontextrestored", this.#onRestored);
    this.#initialize();
  }

  /** Initialize the state of a new or restored context. */
  #initialize(): void {
    const gl = this.#gl;
    gl.getExtension("EXT_color_buffer_float");
    this.#textures = new GpuTextures(gl);
    this.#programs = new Map();
    [this.#buffers, this.#geometries] = [new WeakMap(), new WeakSet()];
  }

  getContext(): WebGL2RenderingContext {
    return this.#gl;
  }

  getPixelRatio(): number {
    return this.#pixelRatio;
  }

  setPixelRatio(ratio: number): void {
    this.#pixelRatio = ratio;
  }

  /** Set the size of the canvas, in CSS pixels. */
  setSize(width: number, height: number): void {
    const { domElement: canvas } = this;
    [canvas.width, canvas.height] = [width, height].map((size) => Math.floor(size * this.#pixelRatio));
    this.setViewport(0, 0, width, height);
  }

  /**
   * Set the part of the canvas to draw to, in CSS pixels from the lower left corner.
   *
   * @param isClipped - whether the rest is kept when a scene is drawn
   */
  setViewport(x: number, y: number, width: number, height: number, isClipped = false): void {
    this.#viewport = [x, y, width, height].map((value) => Math.round(value * this.#pixelRatio)) as Rectangle;
    this.#scissor = isClipped ? this.#viewport : null;
  }

  getRenderTarget(): WebGLRenderTarget | null {
    return this.#target;
  }

  // Only for three.js, where targets have faces and levels.
  getActiveCubeFace(): number {
    return 0;
  }

  getActiveMipmapLevel(): number {
    return 0;
  }

  setRenderTarget(target: WebGLRenderTarget | null, _face?: number, _level?: number): void {
    this.#target = target;
  }

  /** Upload a texture before it is used. */
  initTexture(texture: Texture): void {
    this.#textures.bind(texture);
  }

  /** Read pixels of a float render target. */
  readRenderTargetPixels(
    target: WebGLRenderTarget,
    ...[x, y, width, height, into]: [...Rectangle, into: Float32Array]
  ): void {
    const gl = this.#gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.#textures.framebuffer(target));
    gl.readPixels(x, y, width, height, gl.RGBA, gl.FLOAT, into);
  }

  /** Clear the target and draw a scene, or an object whose materials are raw. */
  render(scene: Object3D, camera: Camera): void {
    const gl = this.#gl;
    if (gl.isContextLost()) return;
    scene.updateMatrixWorld();
    if (!camera.parent) camera.updateMatrixWorld();
    const viewMatrix = new Matrix4().copyInverse(camera.matrixWorld);
    const items = collectItems(scene, viewMatrix);
    const target = this.#target;
    gl.bindFramebuffer(gl.FRAMEBUFFER, target && this.#textures.framebuffer(target));
    gl.viewport(...(target ? ([0, 0, target.width, target.height] as Rectangle) : this.#viewport));
    const scissor = target ? null : this.#scissor;
    setState(gl, gl.SCISSOR_TEST, scissor !== null);
    if (scissor) gl.scissor(...scissor);
    gl.depthMask(true);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const { isShadow } = scene as Scene;
    gl.blendEquation(isShadow ? gl.MAX : gl.FUNC_ADD);
    for (const item of items) {
      const { mesh, material } = item;
      if (isShadow && (isRaw(material) || mesh.mode !== gl.TRIANGLES)) continue;
      mesh.onBeforeRender(this);
      const [program, values] = this.#programOf(material, scene as Scene);
      const modelViewMatrix = new Matrix4().multiplyMatrices(viewMatrix, mesh.matrixWorld);
      const { projectionMatrix } = camera;
      const matrices = { viewMatrix, modelViewMatrix, projectionMatrix, modelMatrix: mesh.matrixWorld };
      program.use({ ...values, ...matrices }, (texture, unit) => this.#textures.bind(texture, unit));
      this.#applyMaterial(material);
      if (isShadow) {
        gl.enable(gl.BLEND);
        gl.disable(gl.CULL_FACE);
      }
      const enabled = this.#bindAttributes(mesh.geometry, program);
      if (material.transparent && material.side === DoubleSide && !isRaw(material)) {
        gl.enable(gl.CULL_FACE);
        gl.cullFace(gl.FRONT);
        this.#draw(item);
        gl.cullFace(gl.BACK);
      }
      this.#draw(item);
      for (const location of enabled) gl.disableVertexAttribArray(location);
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    if (!target?.texture.generateMipmaps) return;
    this.#textures.bind(target.texture);
    gl.generateMipmap(gl.TEXTURE_2D);
  }

  /** Free all resources; the context is lost. */
  dispose(): void {
    this.domElement.removeEventListener("webglcontextrestored", this.#onRestored);
  }

  forceContextLoss(): void {
    this.#loss?.loseContext();
  }

  forceContextRestore(): void {
    this.#loss?.restoreContext();
  }

  /** Return the program of a material and the values of its uniforms. */
  #programOf(material: Material, scene: Scene): [Program, UniformValues] {
    if (isRaw(material)) {
      const { vertexShader, fragmentShader, uniforms } = material;
      const program = this.#program(vertexShader + fragmentShader, () => [vertexShader, fragmentShader]);
      return [program, Object.fromEntries(Object.entries(uniforms).map(([name, { value }]) => [name, value]))];
    }
    const surface = material as Surface;
    const macros = surfaceMacros(surface, scene);
    const program = this.#program(macros, () => surfaceShaders(surface, macros, scene));
    return [program, surfaceUniforms(surface)];
  }

  #program(key: string, shaders: () => readonly [vertex: string, fragment: string]): Program {
    const program = this.#programs.get(key) ?? new Program(this.#gl, ...shaders());
    this.#programs.set(key, program);
    return program;
  }

  #applyMaterial(material: Material): void {
    const gl = this.#gl;
    setState(gl, gl.BLEND, material.transparent);
    if (material.premultipliedAlpha) gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    else gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    setState(gl, gl.DEPTH_TEST, material.depthTest);
    gl.depthMask(material.depthWrite);
    setState(gl, gl.CULL_FACE, material.side !== DoubleSide);
    gl.cullFace(gl.BACK);
    setState(gl, gl.POLYGON_OFFSET_FILL, material.polygonOffset);
    gl.polygonOffset(material.polygonOffsetFactor, material.polygonOffsetUnits);
  }

  /** Bind the attributes that a program uses; returns their locations. */
  #bindAttributes(geometry: BufferGeometry<any>, { attributes }: Program): number[] {
    const gl = this.#gl;
    if (!this.#geometries.has(geometry)) {
      this.#geometries.add(geometry);
      onDispose(geometry, () => this.#freeBuffers(geometry));
    }
    const enabled = [];
    for (const [name, location] of attributes) {
      const attribute = geometry.attributes[name] as BufferAttribute | GLBufferAttribute | undefined;
      if (!attribute || location < 0) continue; // such as gl_VertexID
      if (attribute instanceof GLBufferAttribute) gl.bindBuffer(gl.ARRAY_BUFFER, attribute.buffer);
      else this.#bindBuffer(attribute, gl.ARRAY_BUFFER);
      gl.enableVertexAttribArray(location);
      gl.vertexAttribPointer(location, attribute.itemSize, gl.FLOAT, false, 0, 0);
      enabled.push(location);
    }
    if (geometry.index) this.#bindBuffer(geometry.index, gl.ELEMENT_ARRAY_BUFFER);
    return enabled;
  }

  #bindBuffer(attribute: BufferAttribute, target: number): void {
    const gl = this.#gl;
    let buffer = this.#buffers.get(attribute);
    if (!buffer) this.#buffers.set(attribute, (buffer = { handle: gl.createBuffer(), version: -1 }));
    gl.bindBuffer(target, buffer.handle);
    if (buffer.version === attribute.version) return;
    buffer.version = attribute.version;
    gl.bufferData(target, attribute.array, attribute.usage);
  }

  #freeBuffers({ attributes, index }: BufferGeometry<any>): void {
    for (const attribute of [...Object.values(attributes), index]) {
      const buffer = attribute && this.#buffers.get(attribute as BufferAttribute);
      if (!buffer) continue;
      if (this.#gl.isBuffer(buffer.handle)) this.#gl.deleteBuffer(buffer.handle); // else its context was lost
      this.#buffers.delete(attribute as BufferAttribute);
    }
  }

  #draw({ mesh, start, count }: DrawItem): void {
    const gl = this.#gl;
    if (mesh.geometry.index) gl.drawElements(mesh.mode, count, gl.UNSIGNED_INT, 4 * start);
    else gl.drawArrays(mesh.mode, start, count);
  }
}

function isRaw(material: Material): material is RawShaderMaterial {
  return material instanceof RawShaderMaterial;
}

function setState(gl: WebGL2RenderingContext, state: number, isOn: boolean): void {
  if (isOn) gl.enable(state);
  else gl.disable(state);
}

/** Return the visible parts of meshes in drawing order: transparent ones last, from back to front. */
function collectItems(scene: Object3D, viewMatrix: Matrix4): DrawItem[] {
  const items: DrawItem[] = [];
  const visit = (object: Object3D): void => {
    if (!object.visible) return;
    if (object instanceof Mesh) items.push(...itemsOf(object, viewMatrix));
    for (const child of object.children) visit(child);
  };
  visit(scene);
  const order = ({ mesh }: DrawItem) => mesh.renderOrder;
  return items.sort((a, b) => {
    const isLater = Number(a.material.transparent) - Number(b.material.transparent);
    return isLater || order(a) - order(b) || (a.material.transparent ? b.depth - a.depth : 0);
  });
}

function itemsOf(mesh: Mesh, viewMatrix: Matrix4): DrawItem[] {
  const { geometry, material, matrixWorld } = mesh;
  const { index, groups, drawRange, boundingSphere, attributes } = geometry;
  const center = new Vector3().copy(boundingSphere?.center ?? new Vector3());
  const { z } = center.applyMatrix4(matrixWorld).applyMatrix4(viewMatrix);
  const nVertices = index?.count ?? attributes.position?.count ?? Infinity;
  const parts = Array.isArray(material) ? groups : [{ start: 0, count: nVertices, materialIndex: 0 }];
  return parts.flatMap(({ start, count, materialIndex = 0 }) => {
    const first = Math.max(start, drawRange.start);
    const shown = Math.min(start + count, drawRange.start + drawRange.count) - first;
    const ofGroup = [material].flat()[materialIndex] as Material | undefined;
    return ofGroup && shown > 0 ? [{ mesh, material: ofGroup, start: first, count: shown, depth: -z }] : [];
  });
}
