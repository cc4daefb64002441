// A three.js mesh that plays a file.

import * as THREE from "three";

import { InvalidInputError } from "../errors.js";
import type { BlockFields, OpenReel, TrackValues } from "../types.js";
import type { Loop } from "./clock.js";
import type {
  ColorAttribute,
  ColorLegend,
  ColorOptions,
  TrackColors,
} from "./color/track_colors.js";
import { type Drawing, createDrawing } from "./drawing.js";
import { canDecode, GpuBackend, type Renderer } from "./gpu/gpu_backend.js";
import { meanPosition, composePicture, withoutFields } from "./loaded_block.js";
import { Materials } from "./materials.js";
import { Playback, type PlaybackEvent, type PlaybackEvents } from "./playback.js";
import type { MeshSetup, Backend } from "./backend.js";
import type { TextureOptions, AppliedTexture } from "./texture/mesh_texture.js";
import type { TextureSource } from "./texture/texture_source.js";

/** Seek positions are rounded to 1 / this of a frame, so that the time of a frame selects it. */
const SEEK_STEPS_PER_FRAME = 1e6;

/** Assumed error of positions, in percent of the diagonal, if the file guarantees no bound. */
const DEFAULT_ERROR_PERCENT = 10;

const RESTORED = "webglcontextrestored";

/** Events of a `ReelMesh`: those of `PlaybackEvents` and of every object of three.js. */
export interface ReelMeshEventMap extends THREE.Object3DEventMap, PlaybackEvents {
  /**
   * The appearance changed while the frame did not: an image of the file was decoded. Pages that
   * render on demand must render again.
   */
  change: object;
}

/** Options of a `ReelMesh`. */
export interface ReelMeshOptions {
  /**
   * A material, or one per label of the face groups "material" plus one for faces without a label.
   * The mesh does not dispose of them. Default: the materials of the file.
   */
  material?: THREE.Material | THREE.Material[];
  /** Whether the default materials use flat shading. Default: false. */
  flat?: boolean;
  /**
   * The renderer of the mesh. Default: the first renderer that draws the mesh; its first image will
   * not contain the mesh.
   */
  renderer?: Renderer;
  /** False forces the computation of positions on the CPU. Default: true. */
  gpu?: boolean;
  /**
   * Point of the model that becomes the origin of the mesh, in model units. Default: (0, 0, 0). Use
   * `reel.info.center` for models far from the origin, where float32 is imprecise.
   */
  origin?: readonly [number, number, number];
  /** Whether `dispose()` also closes the file. Default: false. */
  ownsReel?: boolean;
}

/**
 * A mesh that plays a file, in model units. Initially it is paused at time 0.
 *
 * Positions and normals are computed on the GPU with WebGL 2, into the attributes of the geometry,
 * so that every material, shadow and effect works as with any other mesh. For other renderers, such
 * as `WebGPURenderer`, and GPUs that cannot render to float textures, the CPU computes them; see
 * `isOnGpu`.
 *
 * Meshes cannot be cloned: create another one of the same file.
 *
 * The page must call `update` before each redraw. At most two blocks of frames are in memory: the
 * current one and the next. During a damaged block the last picture stays; then playback continues.
 */
export class ReelMesh extends THREE.Mesh<
  THREE.BufferGeometry,
  THREE.Material | THREE.Material[],
  ReelMeshEventMap
> {
  override readonly type = "ReelMesh";
  readonly #send = (event: PlaybackEvent | { type: "change" }) => this.dispatchEvent(event);
  #setup: MeshSetup;
  readonly #playback: Playback;
  readonly #materials: Materials | undefined;
  #backend: Backend | null = null;
  #cpuSwitch: Promise<void> | null = null;
  #isDisposed = false;
  #renderer: THREE.WebGLRenderer | null = null;
  readonly #ownsReel: boolean | undefined;
  #texture: AppliedTexture | null = null;
  #appearanceRequest: AbortController | null = null;
  #colors: TrackColors | null = null;
  /** Fields of the coloring track, by block of the mesh that is being loaded. */
  readonly #pendingColors = new WeakMap<BlockFields, BlockFields>();
  /** Domain by which the vertices of the geometry are split. */
  #split: TrackColors["split"] = null;
  readonly #pickMesh = new THREE.Mesh();
  #isPickMeshStale = true;
  readonly #centroid = new THREE.Vector3();

  /** @throws InvalidInputError if the file has no frames. */
  constructor(
    readonly reel: OpenReel,
    options: ReelMeshOptions = {},
  ) {
    const { info, surface } = reel;
    const drawing = createDrawing(surface, info.nVerts);
    const origin = options.origin ?? [0, 0, 0];
    const [x, y, z] = info.center;
    const shift = [x - origin[0], y - origin[1], z - origin[2]] as const;
    super(createGeometry(drawing));
    this.name = info.name;
    this.#setup = { info, triangles: surface.triangles, drawing, shift };
    this.#setBounds();
    this.#ownsReel = options.ownsReel;
    if (options.material) this.material = options.material;
    else {
      this.#materials = new Materials(surface, drawing, options.flat, this.#send);
      const { list } = this.#materials;
      this.material = drawing.groups.length ? list : list[0];
    }
    this.#playback = new Playback(
      info,
      (block, signal) => this.#loadBlock(block, signal),
      {
        upload: async (block) => {
          const colors = this.#pendingColors.get(block);
          const canHold = (one: BlockFields) => this.#backend?.canHold(one);
          if (!(canHold(block) && canHold(colors ?? block))) await this.#switchToCpu();
          const loaded = withoutFields(block);
          this.#backend?.upload(block, loaded);
          if (colors) this.#colors?.addBlock(colors, withoutFields(colors), loaded);
          return loaded;
        },
        release: (block) => {
          this.#backend?.release(block);
          this.#colors?.removeBlock(block);
        },
        show: (moment) => {
          const picture = composePicture(moment);
          this.#backend?.show(picture);
          const colorMoment = this.#colors?.toTrackMoment(moment);
          if (colorMoment) this.#colors?.show(composePicture(colorMoment));
          this.#isPickMeshStale = true;
          this.#centroid.set(...meanPosition(picture));
          this.geometry.setDrawRange(0, Infinity);
        },
      },
      this.#send,
    );
    if (options.gpu === false) void this.#switchToCpu();
    else if (options.renderer) this.setRenderer(options.renderer);
  }

  // Deferred, since passes must not change the state of a renderer that is drawing.
  override onBeforeRender = (renderer: THREE.WebGLRenderer): void => {
    if (!this.#backend) queueMicrotask(() => this.setRenderer(renderer));
  };

  /** Set the renderer, once; starts loading blocks. Later calls have no effect. */
  setRenderer(renderer: Renderer): void {
    if (this.#backend || this.#cpuSwitch) return;
    if (!canDecode(renderer, this.#setup)) return void this.#switchToCpu();
    this.#renderer = renderer;
    renderer.domElement.addEventListener(RESTORED, this.#switchToGpu);
    this.#switchToGpu();
  }

  /** Whether positions are computed on the GPU; false until the renderer is set. */
  get isOnGpu(): boolean {
    return this.#backend?.isOnGpu ?? false;
  }

  /**
   * Vertex of the file of each vertex of the geometry, which has additional vertices at UV seams and
   * hard edges.
   */
  get sources(): Uint32Array {
    return this.#setup.drawing.sources;
  }

  /**
   * Play from the current time, or from the start if the end was reached. Retries blocks that failed
   * to load, except for damaged ones.
   */
  play(): void {
    this.#playback.play();
  }

  /** Retry blocks that failed to load, such as without a connection; damaged ones are not retried. */
  retry(): void {
    this.#playback.retry();
  }

  pause(): void {
    this.#playback.pause();
  }

  /** Whether it plays, or will once it no longer waits. */
  get isPlaying(): boolean {
    return this.#playback.isPlaying;
  }

  /** Whether it waits for a block or a video; the time and the picture do not change meanwhile. */
  get isWaiting(): boolean {
    return this.#playback.isWaiting;
  }

  /**
   * Seek to a time in seconds since the first frame, or to a frame, which may be fractional. The
   * position is clamped to the first and the last frame.
   *
   * @throws InvalidInputError if it is not a finite number.
   */
  seek(to: number | { frame: number }): void {
    const { clock } = this.#playback;
    const position = typeof to === "number" ? to * clock.fps : to.frame;
    this.#playback.seek(Math.round(position * SEEK_STEPS_PER_FRAME) / SEEK_STEPS_PER_FRAME);
  }

  /**
   * Advance the time, if playing, and compute the picture. Call it before each redraw of the page.
   *
   * @param deltaSeconds - seconds since the last call
   * @throws InvalidInputError if it is negative or not finite.
   */
  update(deltaSeconds: number): void {
    this.#playback.update(deltaSeconds);
  }

  /** Time in seconds since the first frame; `seek` changes it. */
  get time(): number {
    return this.#playback.clock.time;
  }

  /** Duration of the played frames, in seconds. */
  get duration(): number {
    return this.#playback.clock.duration;
  }

  /** Number of played frames: those of the file, or of the video if it is shorter. */
  get nFrames(): number {
    return this.#playback.clock.nFrames;
  }

  /** Current frame, counted from 0. */
  get frame(): number {
    return this.#playback.clock.current(false).frame;
  }

  /** What happens at the end. Default: "repeat". */
  get loop(): Loop {
    return this.#playback.clock.loop;
  }

  set loop(loop: Loop) {
    this.#playback.setLoop(loop);
  }

  /** Playback rate; negative values play backwards. Default: 1. */
  get speed(): number {
    return this.#playback.clock.speed;
  }

  set speed(speed: number) {
    this.#playback.setSpeed(speed);
  }

  /** Whether to interpolate between frames. Default: true. */
  get interpolate(): boolean {
    return this.#playback.isInterpolating;
  }

  set interpolate(isOn: boolean) {
    this.#playback.isInterpolating = isOn;
  }

  /**
   * Number of animated modes of each block, most important first. The others stay at their mean over
   * the block, and corrections are omitted: a coarser animation that shows what modes contribute.
   * Default: Infinity, all modes. Only files of the method "reel" have modes: for others, all values
   * but Infinity throw an `InvalidInputError`.
   */
  get modes(): number {
    return this.#playback.nActiveModes;
  }

  set modes(count: number) {
    const { method } = this.reel.info;
    if (method !== "reel" && count < Infinity) {
      throw new InvalidInputError(`files of the method ${method} have no modes; got ${count}`);
    }
    if (!(count >= 1)) throw new InvalidInputError(`modes must be at least 1; got ${count}`);
    this.#playback.nActiveModes = count;
  }

  /**
   * Compute the mean of all vertices in the current picture, in the space of the mesh, such as for a
   * camera that follows the model. Ignores corrections; reads nothing back from the GPU.
   *
   * @param target - receives the result and is returned
   */
  getCentroid(target: THREE.Vector3): THREE.Vector3 {
    return target.set(...this.#setup.shift).add(this.#centroid);
  }

  /**
   * Show an image or a video in place of the images of the file, on all current materials of the
   * mesh; null removes it. UVs and other properties of the materials do not change. A new call
   * cancels a pending one, which throws an `AbortError`.
   *
   * With a video, the mesh follows the displayed image of the video, and both are updated together.
   * `play`, `pause`, `seek`, `loop` and `speed` control the video, and controls of the video element
   * control the mesh. The video waits for blocks that are not loaded. Only the common duration is
   * played; the event "warning" reports a difference of more than one frame. Videos play only
   * forwards. The mesh does not dispose of a video element that was passed.
   *
   * @param source - an address, whose extension (or `kind`) tells an image from a video; an element,
   *   a bitmap, or a three.js texture, whose orientation and color space are used as they are
   * @throws InvalidInputError if the file has no UVs, or an option has no effect.
   * @throws SourceError if the image or video cannot be loaded, or the page must not read it.
   */
  async setTexture(source: TextureSource | null, options: TextureOptions = {}): Promise<void> {
    this.#removeTexture();
    void this.#setColors(null);
    if (source === null) return;
    const { signal } = (this.#appearanceRequest = new AbortController());
    const { applyTexture } = await import("./texture/mesh_texture.js");
    signal.throwIfAborted();
    const { material } = this;
    const mesh = {
      materials: Array.isArray(material) ? material : [material],
      isDefault: (one: THREE.Material) => this.#materials?.isDefault(one) ?? false,
      imagesReady: this.#materials?.imagesReady,
      uvNames: this.#setup.drawing.uvNames,
      playback: this.#playback,
      send: this.#send,
    };
    this.#texture = await applyTexture(mesh, source, options, signal);
  }

  /** The texture of `setTexture`, or null. */
  get texture(): THREE.Texture | null {
    return this.#texture?.texture ?? null;
  }

  /** The video of `setTexture`, such as to control its sound, or null. */
  get video(): HTMLVideoElement | null {
    return this.#texture?.video ?? null;
  }

  /**
   * Color the mesh by a track, on all its current materials, in place of their colors and images;
   * null restores them. A new call of this method or of `setTexture` cancels a pending one, which
   * throws an `AbortError`.
   *
   * Values are computed like positions and looked up in the color map per pixel; missing values are
   * gray. Values are interpolated between frames. All blocks are loaded again, together with those
   * of the track. For tracks of faces or corners the vertices of the geometry are split, which
   * changes `geometry` and `sources`. A block of the track that cannot be loaded is gray, and
   * reported by the event "error".
   *
   * @example
   * const { range, unit } = await mesh.colorBy("stress");
   * await mesh.colorBy("velocity", { component: 2, range: [-1, 1] });
   *
   * @param name - name of the track
   * @returns The data of a legend; null without a track.
   * @throws InvalidInputError if there is no such track, or an option does not apply to it; if no
   *   material has a map, or the file has four or more UV sets.
   * @throws like `OpenTrack.frame`
   */
  async colorBy(name: string, options?: ColorOptions): Promise<ColorLegend>;
  async colorBy(name: null): Promise<null>;
  async colorBy(name: string | null, options: ColorOptions = {}): Promise<ColorLegend | null> {
    this.#removeTexture();
    if (name === null) {
      await this.#setColors(null);
      return null;
    }
    const { signal } = (this.#appearanceRequest = new AbortController());
    const track = this.reel.track(name);
    const { TrackColors } = await import("./color/track_colors.js");
    signal.throwIfAborted();
    const { info, drawing } = this.#setup;
    const materials = Array.isArray(this.material) ? this.material : [this.material];
    const onError = (error: Error, block: number) =>
      this.#send({ type: "error", error, block, track: name });
    const mesh = { info, materials, uvNames: drawing.uvNames, onError };
    const colors = await TrackColors.create(track, options, mesh, signal);
    signal.throwIfAborted();
    await this.#setColors(colors);
    return colors.legend;
  }

  /**
   * Encode other values of the coloring track, such as those of an original, as an attribute for
   * another mesh with the same index. The material of that mesh must use `map` and `vertexColors` of
   * this one. Valid until the next `colorBy`.
   *
   * @param values - values of a frame: one row per vertex, face or corner of the file
   * @throws InvalidInputError if no track colors the mesh, or the number of values differs.
   */
  colorAttribute(values: TrackValues): ColorAttribute {
    if (!this.#colors) throw new InvalidInputError("call colorBy first");
    return this.#colors.colorAttribute(values, this.#setup.drawing.items);
  }

  /**
   * Decode the positions of a frame: 3 numbers per vertex of the file, in model units.
   *
   * @throws like `OpenReel.frame`
   */
  positionsAt(
    frame: number,
    options?: { signal?: AbortSignal },
  ): Promise<Float32Array | Float64Array> {
    return this.reel.frame(frame, undefined, options);
  }

  /**
   * Intersect the current picture. `faceIndex` is a triangle of the file; `face` has vertices of the
   * geometry, see `sources`.
   */
  override raycast(raycaster: THREE.Raycaster, intersects: THREE.Intersection[]): void {
    if (this.geometry.drawRange.count === 0) return;
    const pickMesh = this.#readableMesh();
    pickMesh.matrixWorld.copy(this.matrixWorld);
    pickMesh.material = this.material;
    const hits: THREE.Intersection[] = [];
    pickMesh.raycast(raycaster, hits);
    for (const hit of hits) {
      const faceIndex = hit.faceIndex as number;
      const { order } = this.#setup.drawing;
      intersects.push({ ...hit, object: this, faceIndex: order ? order[faceIndex] : faceIndex });
    }
  }

  /** Position of a vertex of the geometry in the current picture. */
  override getVertexPosition(index: number, target: THREE.Vector3): THREE.Vector3 {
    return this.#readableMesh().getVertexPosition(index, target);
  }

  /** Free all resources and cancel loading; the mesh must not be used afterwards. */
  override dispose(): void {
    this.dispatchEvent({ type: "dispose" });
    this.#isDisposed = true;
    this.#removeTexture();
    this.#colors?.dispose();
    this.onBeforeRender = () => {};
    this.#playback.dispose();
    this.#renderer?.domElement.removeEventListener(RESTORED, this.#switchToGpu);
    this.#backend?.dispose();
    this.geometry.dispose();
    this.#materials?.dispose();
    if (this.#ownsReel) this.reel.close();
  }

  /** Also called when a lost context is restored, without its data. */
  readonly #switchToGpu = (): void => {
    this.#rebuildGeometry();
    let backend: Backend;
    try {
      const renderer = this.#renderer as THREE.WebGLRenderer;
      backend = new GpuBackend(renderer, this.#setup, this.geometry);
    } catch {
      return void this.#switchToCpu(); // the driver rejects a program
    }
    this.#setBackend(backend);
  };

  /** Loaded on demand, since few pages need it. */
  #switchToCpu(): Promise<void> {
    this.#cpuSwitch ??= import("./cpu_backend.js").then(
      ({ CpuBackend }) => {
        this.#rebuildGeometry();
        this.#setBackend(new CpuBackend(this.#setup, this.geometry));
      },
      (error: Error) => this.#send({ type: "error", error, block: null }),
    );
    return this.#cpuSwitch;
  }

  #setBackend(backend: Backend): void {
    this.#cpuSwitch = null;
    if (this.#isDisposed) return backend.dispose();
    this.#backend?.dispose();
    this.#backend = backend;
    this.#restart(backend);
  }

  #restart(backend: Backend): void {
    this.#colors?.attach(backend, this.#setup.drawing.items);
    this.#playback.restart();
  }

  async #loadBlock(number: number, signal: AbortSignal): Promise<BlockFields> {
    const [block, colors] = await Promise.all([
      this.reel.fields(number, { signal }),
      this.#colors?.fields(number, signal),
    ]);
    if (colors) this.#pendingColors.set(block, colors);
    return block;
  }

  async #setColors(colors: TrackColors | null): Promise<void> {
    if (colors === this.#colors) return;
    this.#colors?.dispose();
    this.#colors = colors;
    const backend = this.#backend;
    if (!backend) return;
    if ((colors?.split ?? null) === this.#split) this.#restart(backend);
    else if (backend.isOnGpu) this.#switchToGpu();
    else await this.#switchToCpu();
  }

  /** Prepare the geometry for a new backend and for the split that the colors need. */
  #rebuildGeometry(): void {
    this.geometry.dispose(); // also frees the buffers of attributes that will be replaced
    const split = this.#colors?.split ?? null;
    if (split === this.#split) return;
    this.#split = split;
    const { surface, info } = this.reel;
    const drawing = createDrawing(surface, info.nVerts, split);
    this.#setup = { ...this.#setup, drawing };
    this.geometry = createGeometry(drawing);
    this.#pickMesh.geometry = new THREE.BufferGeometry();
    this.#setBounds();
  }

  #removeTexture(): void {
    this.#appearanceRequest?.abort();
    this.#texture?.remove();
    this.#texture = null;
  }

  /** Set bounds that contain all frames, including the coding error. */
  #setBounds(): void {
    const { info, shift } = this.#setup;
    const radius = info.diagonal * (0.5 + (info.maxErrorPercent ?? DEFAULT_ERROR_PERCENT) / 100);
    const sphere = new THREE.Sphere(new THREE.Vector3(...shift), radius);
    this.geometry.boundingSphere = sphere;
    this.geometry.boundingBox = sphere.getBoundingBox(new THREE.Box3());
  }

  /** Return a mesh with the current positions in memory. */
  #readableMesh(): THREE.Mesh {
    const { geometry } = this.#pickMesh;
    if (!geometry.index) {
      const { index, groups, boundingSphere, attributes } = this.geometry;
      // Static attributes, which are in memory already.
      const others = Object.fromEntries(
        this.#setup.drawing.attributes.map(({ name }) => [name, attributes[name]]),
      );
      const position = new THREE.BufferAttribute(new Float32Array(3 * this.sources.length), 3);
      Object.assign(geometry, {
        index,
        groups,
        boundingSphere,
        attributes: { ...others, position },
      });
    }
    if (this.#isPickMeshStale) {
      this.#backend?.read(geometry.attributes.position.array as Float32Array);
      this.#isPickMeshStale = false;
    }
    return this.#pickMesh;
  }
}

/** Create a geometry that draws nothing until there is a picture. */
function createGeometry(drawing: Drawing): THREE.BufferGeometry {
  const geometry = new THREE.BufferGeometry();
  geometry.setIndex(new THREE.BufferAttribute(drawing.index, 1));
  const none = { width: 3, values: new Float32Array(3) }; // until a backend replaces it
  const [position, normal] = ["position", "normal"].map((name) => ({ name, ...none }));
  for (const { name, width, values } of [position, normal, ...drawing.attributes]) {
    geometry.setAttribute(name, new THREE.BufferAttribute(values, width));
  }
  for (const { start, count, materialIndex } of drawing.groups) {
    geometry.addGroup(start, count, materialIndex);
  }
  geometry.setDrawRange(0, 0);
  return geometry;
}
