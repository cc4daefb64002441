// A three.js mesh that plays a file.

import * as THREE from "three";

import { InvalidInputError } from "../errors.js";
import type { BlockFields, BlockInfo, OpenReel, OpenSegments, TrackValues } from "../types.js";
import type { Backend } from "./backend.js";
import type { FrameRange, Loop } from "./clock.js";
import type {
  ColorAttribute,
  ColorLegend,
  ColorOptions,
  TrackColors,
} from "./color/track_colors.js";
import { canDecode, GpuBackend, type Renderer } from "./gpu/gpu_backend.js";
import { meshAttributes } from "./gpu/normals.js";
import { type LoadedBlock, meanPosition, composePicture, withoutFields } from "./loaded_block.js";
import { asSegments, MeshSegment } from "./mesh_segment.js";
import { Playback, type PlaybackEvent, type PlaybackEvents } from "./playback.js";
import type { TextureOptions, AppliedTexture } from "./texture/mesh_texture.js";
import type { TextureSource } from "./texture/texture_source.js";

/** Seek positions are rounded to 1 / this of a frame, so that the time of a frame selects it. */
const SEEK_STEPS_PER_FRAME = 1e6;

/** Segments in memory: the current one, the next one, and the one before, whose shaders are shared. */
const MAX_SEGMENTS = 3;

const RESTORED = "webglcontextrestored";

/** Number of meshes that own a file: the last one closes it. */
const nOwners = new WeakMap<OpenSegments, number>();

/** Events of a `ReelMesh`: those of `PlaybackEvents` and of every object of three.js. */
export interface ReelMeshEventMap extends THREE.Object3DEventMap, PlaybackEvents {
  /**
   * The appearance changed while the frame did not: an image of the file was decoded. Pages that
   * render on demand must render again.
   */
  change: object;
  /** A picture of another segment is shown: `geometry`, `material` and `reel` have changed. */
  segment: { segment: number };
}

/** Options of a `ReelMesh`. */
export interface ReelMeshOptions {
  /**
   * A material, or one per label of the face groups "material" plus one for faces without a label.
   * The mesh does not dispose of them. Default: the materials of each segment of the file.
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
  /** Whether `dispose()` also closes the file, unless a clone still plays it. Default: false. */
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
 * In a file with several segments, each has its own geometry and materials, which are prepared
 * before they are shown.
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
  /** The file, with one or more segments. */
  readonly file: OpenSegments;
  readonly #options: ReelMeshOptions;
  /** Segments in memory, the one loaded last at the end. */
  readonly #segments: Map<number, MeshSegment>;
  /** The segment of the shown picture; before the first picture, the first segment. */
  #current: MeshSegment;
  readonly #playback: Playback;
  /** Creates the backend of a segment; null until the renderer is set. */
  #createBackend: ((segment: MeshSegment) => Backend) | null = null;
  /** Segments of the loaded blocks. */
  readonly #segmentOf = new Map<LoadedBlock, MeshSegment>();
  #cpuSwitch: Promise<void> | null = null;
  #isDisposed = false;
  #renderer: THREE.WebGLRenderer | null = null;
  #texture: AppliedTexture | null = null;
  #appearanceRequest: AbortController | null = null;
  #colors: TrackColors | null = null;
  /** Fields of the coloring track, by block of the mesh that is being loaded. */
  readonly #pendingColors = new WeakMap<BlockFields, BlockFields>();
  readonly #pickMesh = new THREE.Mesh();
  #isPickMeshStale = true;
  readonly #centroid = new THREE.Vector3();

  /**
   * @param reel - a `ReelFile`, or a `SegmentedReelFile`
   * @throws InvalidInputError if the file has no frames.
   */
  constructor(reel: OpenReel | OpenSegments, options: ReelMeshOptions = {}) {
    super();
    const file = (this.file = asSegments(reel));
    this.#options = options;
    if (options.ownsReel) nOwners.set(file, (nOwners.get(file) ?? 0) + 1);
    this.name = file.info.name;
    this.#current = this.#createSegment(0, file.first);
    this.#segments = new Map([[0, this.#current]]);
    this.geometry = this.#current.geometry;
    this.material = this.segmentMaterial;
    this.#playback = new Playback(
      {
        ...file.info,
        segments: file.segments.map(({ start, nFrames }, i) => {
          return { start, nFrames, blocks: i ? null : file.first.info.blocks };
        }),
        open: (segment, signal) => this.#openSegment(segment, signal),
        load: (segment, block, signal) => this.#loadBlock(segment, block, signal),
      },
      {
        upload: async (block, number) => {
          const segment = this.#segments.get(number) as MeshSegment;
          const colors = this.#pendingColors.get(block);
          const loaded = await withoutFields(block);
          const loadedColors = colors && (await withoutFields(colors));
          const canHold = (one: BlockFields) => segment.backend?.canHold(one);
          if (!(canHold(block) && canHold(colors ?? block))) await this.#switchToCpu();
          segment.backend?.upload(block, loaded);
          if (loadedColors) this.#colors?.addBlock(colors, loadedColors, loaded);
          this.#segmentOf.set(loaded, segment);
          return loaded;
        },
        release: (block) => {
          this.#segmentOf.get(block)?.backend?.release(block);
          this.#segmentOf.delete(block);
          this.#colors?.removeBlock(block);
        },
        show: (moment) => {
          const segment = this.#segmentOf.get(moment.block) as MeshSegment;
          const picture = composePicture(moment);
          segment.backend?.show(picture);
          const colorMoment = this.#colors?.toTrackMoment(moment);
          if (colorMoment) this.#colors?.show(composePicture(colorMoment));
          this.#isPickMeshStale = true;
          this.#centroid.set(...meanPosition(picture));
          segment.geometry.setDrawRange(0, Infinity);
          if (segment !== this.#current) this.#showSegment(segment);
        },
      },
      this.#send,
    );
    if (options.gpu === false) void this.#switchToCpu();
    else if (options.renderer) this.setRenderer(options.renderer);
  }

  /** The file; of several segments, the one that is shown. */
  get reel(): OpenReel {
    return this.#current.reel;
  }

  /** Index of the segment that is shown. */
  get segment(): number {
    return this.#current.number;
  }

  /** The materials of the segment that is shown, even while the page uses others. */
  get segmentMaterial(): THREE.Material | THREE.Material[] {
    return this.#options.material ?? (this.#current.material as THREE.Material);
  }

  // Deferred, since passes must not change the state of a renderer that is drawing.
  override onBeforeRender = (renderer: THREE.WebGLRenderer): void => {
    if (!this.#createBackend) queueMicrotask(() => this.setRenderer(renderer));
  };

  /** Set the renderer, once; starts loading blocks. Later calls have no effect. */
  setRenderer(renderer: Renderer): void {
    if (this.#createBackend || this.#cpuSwitch) return;
    if (!canDecode(renderer, this.#current.setup)) return void this.#switchToCpu();
    this.#renderer = renderer;
    renderer.domElement.addEventListener(RESTORED, this.#switchToGpu);
    this.#switchToGpu();
  }

  /** Whether positions are computed on the GPU; false until the renderer is set. */
  get isOnGpu(): boolean {
    return this.#current.backend?.isOnGpu ?? false;
  }

  /**
   * Vertex of the file of each vertex of the geometry, which has additional vertices at UV seams and
   * hard edges.
   */
  get sources(): Uint32Array {
    return this.#current.setup.drawing.sources;
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

  /** Duration of all `nFrames` frames, in seconds. */
  get duration(): number {
    return this.#playback.clock.duration;
  }

  /** Number of frames: those of the file, or of the video if it is shorter. */
  get nFrames(): number {
    return this.#playback.clock.nFrames;
  }

  /** Current frame, counted from 0. */
  get frame(): number {
    return this.#playback.clock.current(false).frame;
  }

  /**
   * The frames to play; null, the default: all. Times and frames are still counted from the first
   * frame of the file, and `seek` is clamped to the range.
   *
   * @example
   * mesh.range = { start: 24, nFrames: 48 }; // the third second and the fourth, at 24 fps
   *
   * @throws InvalidInputError if the file lacks a frame of the range, or a video plays in sync.
   */
  get range(): FrameRange | null {
    return this.#playback.clock.range;
  }

  set range(range: FrameRange | null) {
    this.#playback.setRange(range);
  }

  /** Whether frames that playback needs now or next are being loaded. */
  get isLoading(): boolean {
    return this.#playback.isLoading;
  }

  /** Frames in memory, which are shown without waiting, as ascending ranges. */
  get buffered(): readonly FrameRange[] {
    return this.#playback.loaded;
  }

  /** What happens at the end of the played frames. Default: "repeat". */
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
    return target.set(...this.#current.setup.shift).add(this.#centroid);
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
    const { materials, setup } = this.#current;
    const mesh = {
      materials: this.#allMaterials(),
      isDefault: (one: THREE.Material) => this.#isDefault(one),
      imagesReady: materials?.imagesReady,
      uvNames: setup.drawing.uvNames,
      playback: this.#playback,
      send: this.#send,
    };
    this.#texture = await applyTexture(mesh, source, options, signal);
    for (const segment of this.#segments.values()) {
      if (segment !== this.#current) this.#applyTexture(segment);
    }
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
   *   material has a map, or the file has four or more UV sets, or several segments.
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
    if (this.file.segments.length > 1) {
      throw new InvalidInputError("a track cannot color a file with several segments");
    }
    const { signal } = (this.#appearanceRequest = new AbortController());
    const track = this.reel.track(name);
    const { TrackColors } = await import("./color/track_colors.js");
    signal.throwIfAborted();
    const { info, drawing } = this.#current.setup;
    const materials = [this.material].flat();
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
    return this.#colors.colorAttribute(values, this.#current.setup.drawing.items);
  }

  /**
   * Decode the positions of a frame: 3 numbers per vertex of the file, in model units.
   *
   * @throws like `OpenReel.frame`
   */
  async positionsAt(
    frame: number,
    options?: { signal?: AbortSignal },
  ): Promise<Float32Array | Float64Array> {
    const { segments } = this.file;
    const number = Math.max(0, segments.findLastIndex(({ start }) => start <= frame));
    const reel = await this.file.segment(number, options);
    return reel.frame(frame - segments[number].start, undefined, options);
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
      const { order } = this.#current.setup.drawing;
      intersects.push({ ...hit, object: this, faceIndex: order ? order[faceIndex] : faceIndex });
    }
  }

  /** Position of a vertex of the geometry in the current picture. */
  override getVertexPosition(index: number, target: THREE.Vector3): THREE.Vector3 {
    return this.#readableMesh().getVertexPosition(index, target);
  }

  /**
   * Create another mesh of the same file at the same time, with the same playback settings. It plays
   * independently and loads blocks separately; the file is shared. Textures of `setTexture` and
   * colors of `colorBy` are not copied.
   */
  override clone(recursive = true): this {
    const renderer = this.#renderer ?? this.#options.renderer;
    const options = { ...this.#options, ...(renderer ? { renderer } : {}) };
    const clone = new ReelMesh(this.file, options);
    THREE.Object3D.prototype.copy.call(clone, this, recursive);
    if (this.material !== this.segmentMaterial) clone.material = this.material;
    const { loop, speed, interpolate, modes, range } = this;
    Object.assign(clone, { loop, speed, interpolate, modes, range });
    clone.#playback.seek(this.#playback.clock.position);
    if (this.isPlaying) clone.play();
    return clone as this;
  }

  /** Free all resources and cancel loading; the mesh must not be used afterwards. */
  override dispose(): void {
    if (this.#isDisposed) return;
    this.dispatchEvent({ type: "dispose" });
    this.#isDisposed = true;
    this.#removeTexture();
    this.#colors?.dispose();
    this.onBeforeRender = () => {};
    this.#playback.dispose();
    this.#renderer?.domElement.removeEventListener(RESTORED, this.#switchToGpu);
    for (const segment of this.#segments.values()) segment.dispose();
    if (!this.#options.ownsReel) return;
    const nOthers = (nOwners.get(this.file) ?? 1) - 1;
    nOwners.set(this.file, nOthers);
    if (nOthers === 0) this.file.close();
  }

  /** Also called when a lost context is restored, without its data. */
  readonly #switchToGpu = (): void => {
    const renderer = this.#renderer as THREE.WebGLRenderer;
    try {
      this.#setBackend(({ number, setup, geometry }) => {
        if (canDecode(renderer, setup)) return new GpuBackend(renderer, geometry, meshAttributes(setup));
        throw new InvalidInputError(`segment ${number} is too large for the GPU`);
      });
    } catch {
      void this.#switchToCpu(); // the driver rejects a program
    }
  };

  /** Loaded on demand, since few pages need it. */
  #switchToCpu(): Promise<void> {
    this.#cpuSwitch ??= import("./cpu_backend.js").then(
      ({ CpuBackend }) =>
        this.#setBackend((segment) => new CpuBackend(segment.setup, segment.geometry)),
      (error: Error) => this.#send({ type: "error", error, block: null }),
    );
    return this.#cpuSwitch;
  }

  /** Set the backend of all segments: the current one stays in memory, and others are loaded again. */
  #setBackend(create: (segment: MeshSegment) => Backend): void {
    this.#cpuSwitch = null;
    if (this.#isDisposed) return;
    const current = this.#current;
    for (const segment of this.#segments.values()) {
      if (segment !== current) this.#removeSegment(segment);
    }
    if (current.rebuildGeometry(this.#colors?.split ?? null)) {
      this.geometry = current.geometry;
      this.#pickMesh.geometry = new THREE.BufferGeometry();
    }
    const backend = create(current);
    this.#createBackend = create;
    current.backend?.dispose();
    current.backend = backend;
    this.#restart(backend);
  }

  #restart(backend: Backend): void {
    const { geometry, setup } = this.#current;
    this.#colors?.attach(backend, geometry, setup.drawing.items);
    this.#playback.restart();
  }

  #createSegment(number: number, reel: OpenReel): MeshSegment {
    const { origin = [0, 0, 0], material, flat } = this.#options;
    return new MeshSegment(number, reel, origin, !material, flat, (event) => this.#send(event));
  }

  async #openSegment(number: number, signal: AbortSignal): Promise<readonly BlockInfo[]> {
    return (await this.file.segment(number, { signal })).info.blocks;
  }

  /** Load a block, and prepare its segment: the buffers and images that its pictures need. */
  async #loadBlock(number: number, block: number, signal: AbortSignal): Promise<BlockFields> {
    const reel = this.#segments.get(number)?.reel ?? (await this.file.segment(number, { signal }));
    const [fields, colors] = await Promise.all([
      reel.fields(block, { signal }),
      this.#colors?.fields(block, signal),
      this.#prepareSegment(number, reel, signal),
    ]);
    const isReel = reel.info.method === "reel";
    const loaded = isReel ? fields : { ...fields, nBlockModes: 0 };
    if (colors) this.#pendingColors.set(loaded, colors);
    return loaded;
  }

  async #prepareSegment(number: number, reel: OpenReel, signal: AbortSignal): Promise<void> {
    if (this.#segments.has(number)) return;
    const segment = this.#createSegment(number, reel);
    try {
      await segment.materials?.imagesReady;
      signal.throwIfAborted();
      segment.backend = this.#createBackend?.(segment) ?? null;
    } catch (error) {
      segment.dispose();
      signal.throwIfAborted();
      await this.#switchToCpu(); // loads all blocks again
      signal.throwIfAborted();
      throw error;
    }
    const used = new Set([this.#current, ...this.#segmentOf.values()]);
    const unused = [...this.#segments.values()].find((one) => !used.has(one));
    if (unused && this.#segments.size >= MAX_SEGMENTS) this.#removeSegment(unused);
    this.#segments.set(number, segment);
    this.#applyTexture(segment);
    for (const value of segment.materials?.list.flatMap((one) => Object.values(one)) ?? []) {
      if (value instanceof THREE.Texture) this.#renderer?.initTexture(value);
    }
  }

  /** Show the texture of `setTexture` on another segment. */
  #applyTexture({ number, setup, materials }: MeshSegment): void {
    if (!this.#texture || !materials) return;
    if (this.#texture.texture.channel < setup.drawing.uvNames.length) {
      return this.#texture.add(materials.list);
    }
    const error = new InvalidInputError(`segment ${number} has no UVs, which the texture needs`);
    this.#send({ type: "error", error, block: null });
  }

  #removeSegment(segment: MeshSegment): void {
    this.#texture?.remove(segment.materials?.list ?? []);
    this.#segments.delete(segment.number);
    segment.dispose();
  }

  /** Show the geometry and the materials of another segment. */
  #showSegment(segment: MeshSegment): void {
    // The page may have replaced the material.
    const isOwn = this.material === this.segmentMaterial;
    this.#current = segment;
    this.geometry = segment.geometry;
    if (isOwn) this.material = this.segmentMaterial;
    this.#pickMesh.geometry = new THREE.BufferGeometry();
    this.dispatchEvent({ type: "segment", segment: segment.number });
  }

  #allMaterials(): THREE.Material[] {
    if (this.material !== this.#current.material) return [this.material].flat();
    return [...this.#segments.values()].flatMap(({ materials }) => materials?.list ?? []);
  }

  #isDefault(material: THREE.Material): boolean {
    return [...this.#segments.values()].some((one) => one.materials?.isDefault(material));
  }

  async #setColors(colors: TrackColors | null): Promise<void> {
    if (colors === this.#colors) return;
    this.#colors?.dispose();
    this.#colors = colors;
    const { backend, split } = this.#current;
    if (!backend) return;
    if ((colors?.split ?? null) === split) this.#restart(backend);
    else if (backend.isOnGpu) this.#switchToGpu();
    else await this.#switchToCpu();
  }

  #removeTexture(): void {
    this.#appearanceRequest?.abort();
    this.#texture?.dispose();
    this.#texture = null;
  }

  /** Return a mesh with the current positions in memory. */
  #readableMesh(): THREE.Mesh {
    const { geometry } = this.#pickMesh;
    if (!geometry.index) {
      const { index, groups, boundingSphere, attributes } = this.geometry;
      // Static attributes, which are in memory already.
      const others = Object.fromEntries(
        this.#current.setup.drawing.attributes.map(({ name }) => [name, attributes[name]]),
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
      this.#current.backend?.read(this.sources, geometry.attributes.position.array as Float32Array);
      this.#isPickMeshStale = false;
    }
    return this.#pickMesh;
  }
}
