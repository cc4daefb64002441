// A three.js mesh that plays a file.

import * as THREE from "three";

import { InvalidInputError } from "../errors.js";
import type { CutPlane, OpenReel, OpenSegments, Surface, TrackValues } from "../types.js";
import type { Backend } from "./backend.js";
import type { FrameRange, Loop } from "./clock.js";
import type {
  ColorAttribute,
  ColorLegend,
  ColorOptions,
  TrackColors,
} from "./color/track_colors.js";
import { CpuBackend } from "./cpu_backend.js";
import { loadMasks } from "./face_masks.js";
import { createGpuBackend, type Renderer } from "./gpu/gpu_backend.js";
import {
  composePicture,
  type LoadedBlock,
  meanPosition,
  type Picture,
  withoutFields,
} from "./loaded_block.js";
import { asSegments, MeshSegment } from "./mesh_segment.js";
import { Playback, type PlaybackEvent, type PlaybackEvents } from "./playback.js";
import type { TextureOptions, AppliedTexture } from "./texture/mesh_texture.js";
import type { TextureSource } from "./texture/texture_source.js";

/** Seek positions are rounded to 1 / this of a frame, so that the time of a frame selects it. */
const SEEK_STEPS_PER_FRAME = 1e6;

/** Segments in memory: the current one, the next one, and the one before, whose shaders are shared. */
const MAX_SEGMENTS = 3;

/** Creates the backend of a segment. */
type CreateBackend = (segment: MeshSegment) => Backend;

const createCpuBackend: CreateBackend = (segment) => new CpuBackend(segment);

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
  /** Whether the default materials use flat shading. Default: for cells of volumes. */
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
 * A mesh that plays a file, in model units. Initially it is paused at time 0. Faces are hidden where
 * the tracks "scanned" (holes of a scan) and "alive" (deleted elements) are 0.
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
  #createBackend: CreateBackend | null = null;
  /** Aborted by `dispose`. */
  readonly #lifetime = new AbortController();
  #renderer: THREE.WebGLRenderer | null = null;
  #texture: AppliedTexture | null = null;
  #appearanceRequest: AbortController | null = null;
  #cutRequest: AbortController | null = null;
  #colors: TrackColors | null = null;
  #picture: Picture = { blocks: [], corrections: new Map() };
  /** A mesh with the current positions in memory; null until it is needed. */
  #readableMesh: THREE.Mesh | null = null;

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
    this.#current = new MeshSegment(0, file.first, options, this.#send);
    this.#segments = new Map([[0, this.#current]]);
    this.geometry = this.#current.geometry;
    this.material = this.segmentMaterial;
    this.#playback = new Playback(
      file,
      {
        load: (segment, block, signal) => this.#loadBlock(segment, block, signal),
        release: (number, block) => {
          this.#segments.get(number)?.release(block);
          this.#colors?.removeBlock(block);
        },
        show: (number, moment) => {
          const segment = this.#segments.get(number) as MeshSegment;
          this.#picture = composePicture(moment);
          segment.backend?.show(this.#picture);
          this.#colors?.show(moment);
          this.#readableMesh = null;
          segment.showFaces(moment.block, moment.t);
          void segment.materials?.loadImages(); // the first picture does not wait for them
          if (segment !== this.#current) this.#showSegment(segment);
        },
      },
      this.#send,
    );
    if (options.gpu === false) this.#setBackend(createCpuBackend);
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
    if (this.#createBackend) return;
    const switchToGpu = () => this.#setBackend((segment) => createGpuBackend(renderer, segment));
    switchToGpu();
    if (!this.isOnGpu) return;
    this.#renderer = renderer as THREE.WebGLRenderer;
    const { signal } = this.#lifetime;
    renderer.domElement.addEventListener("webglcontextrestored", switchToGpu, { signal });
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
    return this.#current.drawing.sources;
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
    const position = typeof to === "number" ? clock.positionAt(to) : to.frame;
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

  /** Whether frames that playback needs now or next are being loaded. */
  get isLoading(): boolean {
    return this.#playback.isLoading;
  }

  /** Frames in memory, which are shown without waiting, as ascending ranges. */
  get buffered(): readonly FrameRange[] {
    return this.#playback.loaded;
  }

  /**
   * Whether it repeats: from the start, or "pingpong", forwards and backwards; false: it stops at the
   * end. The same values as of `<reel-player>`, whose default is false. Default: true.
   *
   * @throws InvalidInputError for other values.
   */
  get loop(): Loop {
    return this.#playback.clock.loop;
  }

  set loop(loop: Loop) {
    if (typeof loop !== "boolean" && loop !== "pingpong") {
      throw new InvalidInputError(`loop must be true, false or "pingpong"; got ${JSON.stringify(loop)}`);
    }
    this.#playback.change({ loop });
  }

  /** Playback rate; negative values play backwards. Default: 1. */
  get speed(): number {
    return this.#playback.clock.speed;
  }

  set speed(speed: number) {
    this.#playback.change({ speed });
  }

  /** Whether to interpolate between frames. Default: true. */
  get interpolate(): boolean {
    return this.#playback.isInterpolating;
  }

  set interpolate(isOn: boolean) {
    this.#playback.isInterpolating = isOn;
  }

  /**
   * Compute the mean of all vertices in the current picture, in the space of the mesh, such as for a
   * camera that follows the model. Ignores corrections; reads nothing back from the GPU.
   *
   * @param target - receives the result and is returned
   */
  getCentroid(target: THREE.Vector3): THREE.Vector3 {
    return target.set(...this.#current.shift).add(new THREE.Vector3(...meanPosition(this.#picture)));
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
    this.#setColors(null);
    if (source === null) return;
    const { signal } = (this.#appearanceRequest = new AbortController());
    const { applyTexture } = await import("./texture/mesh_texture.js");
    signal.throwIfAborted();
    const [segments, current, material] = [this.#segments, this.#current, this.material];
    const mesh = { segments, current, material, playback: this.#playback, send: this.#send };
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
   *   material has a map, or the file has four or more UV sets, or several segments.
   * @throws like `OpenTrack.frame`
   */
  async colorBy(name: string, options?: ColorOptions): Promise<ColorLegend>;
  async colorBy(name: null): Promise<null>;
  async colorBy(name: string | null, options: ColorOptions = {}): Promise<ColorLegend | null> {
    this.#removeTexture();
    if (name === null) {
      this.#setColors(null);
      return null;
    }
    const { signal } = (this.#appearanceRequest = new AbortController());
    const { TrackColors } = await import("./color/track_colors.js");
    signal.throwIfAborted();
    const { drawing } = this.#current;
    const mesh = { file: this.file, drawing, material: this.material, send: this.#send };
    const colors = await TrackColors.create(name, options, mesh, signal);
    signal.throwIfAborted();
    this.#checkCut(this.surface, colors);
    this.#setColors(colors);
    return colors.legend;
  }

  /** The surface that is drawn: that of the file, or of a cut. */
  get surface(): Surface {
    return this.#current.surface;
  }

  /**
   * Hide the cells of a volume mesh beyond a plane, so that the inside is visible; null shows all.
   * See `ReelFile.cut`. Changes `geometry`, `sources` and `surface`, and loads all blocks again. A new
   * call cancels a pending one, which throws an `AbortError`.
   *
   * @throws InvalidInputError if the mesh has no cells, all of them are beyond the plane, the file has
   *   several segments, or a track of faces or corners colors the mesh.
   */
  async cut(plane: CutPlane | null): Promise<void> {
    this.#cutRequest?.abort();
    const { signal } = (this.#cutRequest = new AbortController());
    const segment = this.#current;
    if (plane && this.file.segments.length > 1) {
      throw new InvalidInputError("a file with several segments cannot be cut");
    }
    const surface = plane ? await segment.reel.cut(plane, { signal }) : segment.reel.surface;
    signal.throwIfAborted();
    this.#checkCut(surface, this.#colors);
    segment.surface = surface;
    if (this.#createBackend) this.#setBackend(this.#createBackend);
  }

  /** Faces of a cut are not those of the file. */
  #checkCut(surface: Surface, colors: TrackColors | null): void {
    const { split = null } = colors ?? {};
    if (split && split !== "cell" && surface !== this.#current.reel.surface) {
      throw new InvalidInputError(`a track of each ${split} of the file cannot color a cut mesh`);
    }
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
    return this.#colors.colorAttribute(values, this.#current.drawing.items);
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
    return reel.frame(frame - segments[number].start, null, options);
  }

  /**
   * Intersect the current picture. `faceIndex` is a triangle of `surface`; `face` has vertices of the
   * geometry, see `sources`.
   */
  override raycast(raycaster: THREE.Raycaster, intersects: THREE.Intersection[]): void {
    if (this.geometry.drawRange.count === 0) return;
    const mesh = this.#getReadableMesh();
    mesh.matrixWorld.copy(this.matrixWorld);
    mesh.material = this.material;
    const hits: THREE.Intersection[] = [];
    mesh.raycast(raycaster, hits);
    for (const hit of hits) {
      const faceIndex = hit.faceIndex as number;
      const { order } = this.#current.drawing;
      intersects.push({ ...hit, object: this, faceIndex: order ? order[faceIndex] : faceIndex });
    }
  }

  /** Position of a vertex of the geometry in the current picture. */
  override getVertexPosition(index: number, target: THREE.Vector3): THREE.Vector3 {
    return this.#getReadableMesh().getVertexPosition(index, target);
  }

  /**
   * Create another mesh of the same file at the same time, with the same playback settings. It plays
   * independently and loads blocks separately; the file is shared. Textures of `setTexture` and
   * colors of `colorBy` are not copied.
   */
  override clone(recursive = true): this {
    const renderer = this.#renderer ?? this.#options.renderer;
    const clone = new ReelMesh(this.file, { ...this.#options, renderer });
    THREE.Object3D.prototype.copy.call(clone, this, recursive);
    if (this.material !== this.segmentMaterial) clone.material = this.material;
    const { loop, speed, interpolate } = this;
    Object.assign(clone, { loop, speed, interpolate });
    clone.#playback.seek(this.#playback.clock.position);
    if (this.isPlaying) clone.play();
    return clone as this;
  }

  /** Free all resources and cancel loading; the mesh must not be used afterwards. */
  override dispose(): void {
    if (this.#lifetime.signal.aborted) return;
    this.dispatchEvent({ type: "dispose" });
    this.#lifetime.abort();
    this.#cutRequest?.abort();
    this.#removeTexture();
    this.#colors?.dispose();
    this.#playback.dispose();
    for (const segment of this.#segments.values()) segment.dispose();
    if (!this.#options.ownsReel) return;
    const nOthers = (nOwners.get(this.file) ?? 1) - 1;
    nOwners.set(this.file, nOthers);
    if (nOthers === 0) this.file.close();
  }

  /**
   * Set the backend of all segments, or that of the CPU if it cannot be created: the current segment
   * stays in memory, and others are loaded again.
   */
  #setBackend(create: CreateBackend): void {
    if (this.#lifetime.signal.aborted) return;
    const current = this.#current;
    for (const segment of this.#segments.values()) {
      if (segment !== current) this.#removeSegment(segment);
    }
    current.rebuildGeometry(this.#colors?.split ?? null);
    this.#showGeometry();
    try {
      const backend = create(current);
      current.backend?.dispose();
      current.backend = backend;
    } catch (error) {
      if (create === createCpuBackend) throw error;
      return this.#setBackend(createCpuBackend);
    }
    this.#createBackend = create;
    this.#restart();
  }

  /** Load all blocks, again if necessary. */
  #restart(): void {
    const { backend, geometry, drawing } = this.#current;
    if (backend) this.#colors?.attach(backend, geometry, drawing.items);
    this.#playback.restart();
  }

  /** Load a block, and prepare its segment. */
  async #loadBlock(number: number, block: number, signal: AbortSignal): Promise<LoadedBlock> {
    const loadedSegment = this.#segments.get(number);
    const reel = loadedSegment?.reel ?? (await this.file.segment(number, { signal }));
    const [segment, fields, colors, masks] = await Promise.all([
      loadedSegment ?? this.#prepareSegment(number, reel, signal),
      reel.fields(block, { signal }),
      this.#colors?.fields(block, signal),
      loadMasks(reel, block, signal),
    ]);
    const loaded = withoutFields(fields);
    signal.throwIfAborted();
    try {
      segment.backend ??= (this.#createBackend as CreateBackend)(segment);
      segment.upload(fields, loaded, masks);
      if (colors) this.#colors?.addBlock(colors, loaded);
    } catch (error) {
      if (this.isOnGpu) this.#setBackend(createCpuBackend); // loads all blocks again
      signal.throwIfAborted();
      throw error;
    }
    return loaded;
  }

  /** Create a segment, prepare its images, and add it in place of an unused one. */
  async #prepareSegment(number: number, reel: OpenReel, signal: AbortSignal): Promise<MeshSegment> {
    const segment = new MeshSegment(number, reel, this.#options, this.#send);
    await segment.materials?.loadImages();
    if (signal.aborted) segment.dispose();
    signal.throwIfAborted();
    const unused = [...this.#segments.values()].find((other) => other !== this.#current && !other.nBlocks);
    if (unused && this.#segments.size >= MAX_SEGMENTS) this.#removeSegment(unused);
    this.#segments.set(number, segment);
    this.#texture?.add(segment);
    for (const value of segment.materials?.list.flatMap((material) => Object.values(material)) ?? []) {
      if (value instanceof THREE.Texture) this.#renderer?.initTexture(value);
    }
    return segment;
  }

  #removeSegment(segment: MeshSegment): void {
    this.#texture?.remove(segment);
    this.#segments.delete(segment.number);
    segment.dispose();
  }

  /** Show the geometry and the materials of another segment. */
  #showSegment(segment: MeshSegment): void {
    // The page may have replaced the material.
    const isOwn = this.material === this.segmentMaterial;
    this.#current = segment;
    if (isOwn) this.material = this.segmentMaterial;
    this.#showGeometry();
    this.dispatchEvent({ type: "segment", segment: segment.number });
  }

  #showGeometry(): void {
    this.geometry = this.#current.geometry;
    this.#readableMesh = null;
  }

  #setColors(colors: TrackColors | null): void {
    if (colors === this.#colors) return;
    this.#colors?.dispose();
    this.#colors = colors;
    if (!this.#createBackend) return;
    if ((colors?.split ?? null) === this.#current.split) this.#restart();
    else this.#setBackend(this.#createBackend);
  }

  #removeTexture(): void {
    this.#appearanceRequest?.abort();
    this.#texture?.dispose();
    this.#texture = null;
  }

  #getReadableMesh(): THREE.Mesh {
    if (!this.#readableMesh) {
      const { index, groups, boundingSphere, attributes } = this.geometry;
      const { backend, drawing } = this.#current;
      const positions = new Float32Array(3 * drawing.sources.length);
      backend?.read(drawing.sources, positions);
      // Static attributes are in memory already.
      const others = Object.fromEntries(drawing.attributes.map(({ name }) => [name, attributes[name]]));
      const position = new THREE.BufferAttribute(positions, 3);
      const geometry = new THREE.BufferGeometry();
      Object.assign(geometry, { index, groups, boundingSphere, attributes: { ...others, position } });
      this.#readableMesh = new THREE.Mesh(geometry);
    }
    return this.#readableMesh;
  }
}
