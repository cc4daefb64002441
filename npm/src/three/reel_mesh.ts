// A mesh of three.js that plays a file.

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
import { type Drawing, drawingOf } from "./drawing.js";
import { canDecode, GpuStage, type Renderer } from "./gpu/gpu_stage.js";
import { middleOf, pictureOf, withoutFields } from "./held_block.js";
import { Materials } from "./materials.js";
import { Playback, type PlaybackEvent, type PlaybackEvents } from "./playback.js";
import type { Setting, Stage } from "./stage.js";
import type { TextureOptions, WornTexture } from "./texture/mesh_texture.js";
import type { TextureSource } from "./texture/texture_source.js";

/** Of a frame: what is sought is rounded to these, so that seconds of a frame lead to it. */
const PARTS = 1e6;

/** How much positions may be off, of the diagonal, where the file does not say. */
const UNKNOWN_PERCENT = 10;

const RESTORED = "webglcontextrestored";

/** Events of a `ReelMesh`, beside those of every object: see `PlaybackEvents`. */
export interface ReelMeshEventMap extends THREE.Object3DEventMap, PlaybackEvents {
  /**
   * The mesh looks different at the same frame: an image of the file was decoded. Pages that draw
   * only after a change draw again.
   */
  change: object;
}

/** Options of a `ReelMesh`. */
export interface ReelMeshOptions {
  /**
   * Material, or one for each label of the groups "material" of the file and one more, for faces
   * without a label. The mesh does not dispose of it. Without it materials are those of the file.
   */
  material?: THREE.Material | THREE.Material[];
  /** Whether materials of the mesh's own making show each triangle flat; false by default. */
  flat?: boolean;
  /**
   * What draws the mesh: a `WebGLRenderer`, or any other. Without it the first renderer that draws
   * the mesh is taken, and its first picture comes without the mesh.
   */
  renderer?: Renderer;
  /** False: positions are computed on the CPU, whatever the renderer can do. True by default. */
  gpu?: boolean;
  /**
   * Point of the model that lies at the origin of the mesh, in model units; (0, 0, 0) by default.
   * For models far away from there, for which single precision is coarse, `reel.info.center`.
   */
  origin?: readonly [number, number, number];
  /** Whether `dispose()` closes the file too; false by default. */
  ownsReel?: boolean;
}

/**
 * A mesh that plays a file, in model units. It is paused at first, at time 0.
 *
 * Positions and normals are computed on the GPU, by WebGL 2, into the attributes of the geometry,
 * so that every material, shadow and effect works with them as with any mesh. Other renderers, such
 * as `WebGPURenderer`, and graphics cards that cannot draw into textures of floats get them from
 * the CPU; `isOnGpu` tells.
 *
 * It cannot be cloned: make another one of the same file.
 *
 * A page calls `update` each time before it draws. At most two blocks of frames are held: that of
 * the time and the one played next. A damaged block is passed over: the last picture stays for its
 * time, and the rest plays.
 */
export class ReelMesh extends THREE.Mesh<
  THREE.BufferGeometry,
  THREE.Material | THREE.Material[],
  ReelMeshEventMap
> {
  override readonly type = "ReelMesh";
  readonly #send = (event: PlaybackEvent | { type: "change" }) => this.dispatchEvent(event);
  #setting: Setting;
  readonly #playback: Playback;
  readonly #materials: Materials | undefined;
  #stage: Stage | null = null;
  #becomesCpu: Promise<void> | null = null;
  #isDisposed = false;
  #drawer: THREE.WebGLRenderer | null = null;
  readonly #ownsReel: boolean | undefined;
  #worn: WornTexture | null = null;
  #wearing: AbortController | null = null;
  #colors: TrackColors | null = null;
  /** Of a block on its way, the fields of the track that colours the mesh. */
  readonly #coloring = new WeakMap<BlockFields, BlockFields>();
  /** What vertices of the geometry are split for. */
  #split: TrackColors["split"] = null;
  readonly #picked = new THREE.Mesh();
  #isPickedStale = true;
  readonly #middle = new THREE.Vector3();

  /** @throws InvalidInputError where the file has no frames. */
  constructor(
    readonly reel: OpenReel,
    options: ReelMeshOptions = {},
  ) {
    const { info, surface } = reel;
    const drawing = drawingOf(surface, info.nVerts);
    const origin = options.origin ?? [0, 0, 0];
    const [x, y, z] = info.center;
    const shift = [x - origin[0], y - origin[1], z - origin[2]] as const;
    super(geometryOf(drawing));
    this.name = info.name;
    this.#setting = { info, triangles: surface.triangles, drawing, shift };
    this.#boundAll();
    this.#ownsReel = options.ownsReel;
    if (options.material) this.material = options.material;
    else {
      this.#materials = new Materials(surface, drawing, options.flat, this.#send);
      const { list } = this.#materials;
      this.material = drawing.groups.length ? list : list[0];
    }
    this.#playback = new Playback(
      info,
      (block, signal) => this.#load(block, signal),
      {
        hold: async (block) => {
          const colors = this.#coloring.get(block);
          const canHold = (one: BlockFields) => this.#stage?.canHold(one);
          if (!(canHold(block) && canHold(colors ?? block))) await this.#useCpu();
          const held = withoutFields(block);
          this.#stage?.hold(block, held);
          if (colors) this.#colors?.hold(colors, withoutFields(colors), held);
          return held;
        },
        release: (block) => {
          this.#stage?.release(block);
          this.#colors?.release(block);
        },
        show: (moment) => {
          const picture = pictureOf(moment);
          this.#stage?.show(picture);
          const ofColors = this.#colors?.momentOf(moment);
          if (ofColors) this.#colors?.show(pictureOf(ofColors));
          this.#isPickedStale = true;
          this.#middle.set(...middleOf(picture));
          this.geometry.setDrawRange(0, Infinity);
        },
      },
      this.#send,
    );
    if (options.gpu === false) void this.#useCpu();
    else if (options.renderer) this.setRenderer(options.renderer);
  }

  // Nothing is computed while a renderer draws: its state is not ours then.
  override onBeforeRender = (renderer: THREE.WebGLRenderer): void => {
    if (!this.#stage) queueMicrotask(() => this.setRenderer(renderer));
  };

  /** Tells what draws the mesh; the first one counts. Blocks are loaded from now on. */
  setRenderer(renderer: Renderer): void {
    if (this.#stage || this.#becomesCpu) return;
    if (!canDecode(renderer, this.#setting)) return void this.#useCpu();
    this.#drawer = renderer;
    renderer.domElement.addEventListener(RESTORED, this.#useGpu);
    this.#useGpu();
  }

  /** Whether positions are computed on the GPU; false as long as no renderer is known. */
  get isOnGpu(): boolean {
    return this.#stage?.isOnGpu ?? false;
  }

  /**
   * The vertex of the file that each vertex of the geometry is: there are more, at seams and hard
   * edges.
   */
  get sources(): Uint32Array {
    return this.#setting.drawing.sources;
  }

  /**
   * Plays from the time on, or from the start if the end was reached. Blocks that could not be had,
   * such as for want of a connection, are asked for again; damaged ones are not.
   */
  play(): void {
    this.#playback.play();
  }

  /** Asks again for blocks that could not be had, such as for want of a connection. */
  retry(): void {
    this.#playback.retry();
  }

  /** Stands still at the time. */
  pause(): void {
    this.#playback.pause();
  }

  /** Whether it plays, or will as soon as it need not wait any more. */
  get isPlaying(): boolean {
    return this.#playback.isPlaying;
  }

  /** Whether the picture of the time is not there yet; the last one stays, and so does the time. */
  get isWaiting(): boolean {
    return this.#playback.isWaiting;
  }

  /**
   * Goes to a time: seconds since the first frame, or a frame, whose fractions lie on the way to
   * the next. What is beyond the first or last frame is moved there.
   *
   * @throws InvalidInputError if it is not a finite number.
   */
  seek(to: number | { frame: number }): void {
    const { clock } = this.#playback;
    const place = typeof to === "number" ? to * clock.fps : to.frame;
    this.#playback.seek(Math.round(place * PARTS) / PARTS);
  }

  /**
   * Lets the time pass, if it plays, and computes what is shown then. To be called before each
   * picture that the page draws.
   *
   * @param deltaSeconds - since the last call
   * @throws InvalidInputError if it is negative or not finite.
   */
  update(deltaSeconds: number): void {
    this.#playback.update(deltaSeconds);
  }

  /** Seconds since the first frame; `seek` changes it. */
  get time(): number {
    return this.#playback.clock.time;
  }

  /** Seconds from the first frame to the end of the last, or that of its video if it is shorter. */
  get duration(): number {
    return this.#playback.clock.duration;
  }

  /** Frames that are played: those of the file, or of its video if these are fewer. */
  get nFrames(): number {
    return this.#playback.clock.nFrames;
  }

  /** The frame of the time, from 0 on. */
  get frame(): number {
    return this.#playback.clock.at(false).frame;
  }

  /** What happens at the end; "repeat" by default. */
  get loop(): Loop {
    return this.#playback.clock.loop;
  }

  set loop(loop: Loop) {
    this.#playback.setLoop(loop);
  }

  /** Seconds of the animation in a second, 1 by default; backwards if negative. */
  get speed(): number {
    return this.#playback.clock.speed;
  }

  set speed(speed: number) {
    this.#playback.setSpeed(speed);
  }

  /** Whether pictures between frames are shown; true by default. */
  get interpolate(): boolean {
    return this.#playback.isInterpolating;
  }

  set interpolate(isOn: boolean) {
    this.#playback.isInterpolating = isOn;
  }

  /**
   * How many modes of each block move, most important first: with fewer than all, the others rest
   * at their mean over the block, and vertices are not corrected. A coarser animation, that tells
   * what a mode is good for. Infinity, by default, for all. Only files of the method "reel" have
   * modes: others throw an `InvalidInputError`, but for Infinity.
   */
  get modes(): number {
    return this.#playback.nMoving;
  }

  set modes(count: number) {
    const { method } = this.reel.info;
    if (method !== "reel" && count < Infinity) {
      throw new InvalidInputError(`files of the method ${method} have no modes; got ${count}`);
    }
    if (!(count >= 1)) throw new InvalidInputError(`modes must be at least 1; got ${count}`);
    this.#playback.nMoving = count;
  }

  /**
   * The mean of all vertices in the picture that is shown, in model units from the origin of the
   * mesh: what a camera follows. Nothing is read from the GPU. Corrections are left out.
   *
   * @param target - gets it, and is given back
   */
  getMiddle(target: THREE.Vector3): THREE.Vector3 {
    return target.set(...this.#setting.shift).add(this.#middle);
  }

  /**
   * Shows an image or a video in place of the images of the file, on all materials that the mesh
   * has now; null: none. Texture coordinates and all else of the materials stay. The last call
   * counts: one that is under way throws an `AbortError`.
   *
   * With a video, the mesh follows the picture that the video shows, and both are shown at once;
   * `play`, `pause`, `seek`, `loop` and `speed` drive the video, whose sound plays, and its own
   * controls drive the mesh. Where a block is not there yet, the video waits for it. Only what both
   * have in common is played; if one is longer by more than a frame, the event "warning" says so.
   * Both play forwards only. A video element is not disposed of with the mesh.
   *
   * @param source - an address, whose name says whether it is an image or a video (or `kind` does);
   *   an element, a bitmap or a texture of three.js, whose orientation and colour space are its own
   * @throws InvalidInputError where the file has no texture coordinates, or an option is of no use.
   * @throws SourceError where the image or the video cannot be had, or the page may not read it.
   */
  async setTexture(source: TextureSource | null, options: TextureOptions = {}): Promise<void> {
    this.#takeOff();
    void this.#setColors(null);
    if (source === null) return;
    const { signal } = (this.#wearing = new AbortController());
    const { wear } = await import("./texture/mesh_texture.js");
    signal.throwIfAborted();
    const { material } = this;
    const mesh = {
      materials: Array.isArray(material) ? material : [material],
      isPlain: (one: THREE.Material) => this.#materials?.isPlain(one) ?? false,
      dressed: this.#materials?.dressed,
      uvNames: this.#setting.drawing.uvNames,
      playback: this.#playback,
      send: this.#send,
    };
    this.#worn = await wear(mesh, source, options, signal);
  }

  /** What `setTexture` shows; null for nothing. */
  get texture(): THREE.Texture | null {
    return this.#worn?.texture ?? null;
  }

  /** The video that `setTexture` shows, for its sound; null where there is none. */
  get video(): HTMLVideoElement | null {
    return this.#worn?.video ?? null;
  }

  /**
   * Shows a track in colours, on all materials that the mesh has now, in place of their colours and
   * images; null: the mesh looks as before. The last call of this and `setTexture` counts: one that
   * is under way throws an `AbortError`.
   *
   * Numbers are computed where positions are, and looked up in the map for each pixel; what has no
   * number is grey. Pictures between frames have numbers between theirs. Blocks are loaded anew, with
   * those of the track; for a track of faces or corners vertices of the geometry are split, so that
   * `geometry` and `sources` are others then. A block of the track that cannot be had is grey, and
   * told by the event "error".
   *
   * @example
   * const { range, unit } = await mesh.colorBy("stress");
   * await mesh.colorBy("velocity", { component: 2, range: [-1, 1] });
   *
   * @param name - of a track of the file
   * @returns What the colours mean, for a legend; null without a track.
   * @throws InvalidInputError where there is no such track, or an option does not fit it; where no
   *   material has a map, or the file has four sets of texture coordinates or more.
   * @throws what `OpenTrack.frame` throws
   */
  async colorBy(name: string, options?: ColorOptions): Promise<ColorLegend>;
  async colorBy(name: null): Promise<null>;
  async colorBy(name: string | null, options: ColorOptions = {}): Promise<ColorLegend | null> {
    this.#takeOff();
    if (name === null) {
      await this.#setColors(null);
      return null;
    }
    const { signal } = (this.#wearing = new AbortController());
    const track = this.reel.track(name);
    const { TrackColors } = await import("./color/track_colors.js");
    signal.throwIfAborted();
    const { info, drawing } = this.#setting;
    const materials = Array.isArray(this.material) ? this.material : [this.material];
    const onError = (error: Error, block: number) =>
      this.#send({ type: "error", error, block, track: name });
    const mesh = { info, materials, uvNames: drawing.uvNames, onError };
    const colors = await TrackColors.of(track, options, mesh, signal);
    signal.throwIfAborted();
    await this.#setColors(colors);
    return colors.legend;
  }

  /**
   * Other values of the track that colours the mesh, such as those of an original, in its colours:
   * the attribute of another mesh with the index and vertices of this `geometry`. The material of
   * that mesh takes over `map` and `vertexColors` of this one, until the next `colorBy`.
   *
   * @param values - of a frame: each vertex, face or corner of the file has its row of numbers
   * @throws InvalidInputError where no track colours the mesh, or it has not so many numbers.
   */
  colorsOf(values: TrackValues): ColorAttribute {
    if (!this.#colors) throw new InvalidInputError("no track colours the mesh; see colorBy");
    return this.#colors.attributeOf(values, this.#setting.drawing.items);
  }

  /**
   * Positions of a frame as the file has them: 3 numbers for each of its vertices, in model units.
   *
   * @throws what `OpenReel.frame` throws
   */
  positionsAt(
    frame: number,
    options?: { signal?: AbortSignal },
  ): Promise<Float32Array | Float64Array> {
    return this.reel.frame(frame, undefined, options);
  }

  /**
   * Hits of the picture that is shown; none before there is one. `faceIndex` is the triangle of the
   * file; `face` has vertices of the geometry, see `sources`.
   */
  override raycast(raycaster: THREE.Raycaster, intersects: THREE.Intersection[]): void {
    if (this.geometry.drawRange.count === 0) return;
    const picked = this.#shownMesh();
    picked.matrixWorld.copy(this.matrixWorld);
    picked.material = this.material;
    const hits: THREE.Intersection[] = [];
    picked.raycast(raycaster, hits);
    for (const hit of hits) {
      const faceIndex = hit.faceIndex as number;
      const { order } = this.#setting.drawing;
      intersects.push({ ...hit, object: this, faceIndex: order ? order[faceIndex] : faceIndex });
    }
  }

  /** Position of a vertex of the geometry in the picture that is shown. */
  override getVertexPosition(index: number, target: THREE.Vector3): THREE.Vector3 {
    return this.#shownMesh().getVertexPosition(index, target);
  }

  /** Frees all that the mesh has made, and aborts loading. It must not be used any more. */
  override dispose(): void {
    this.dispatchEvent({ type: "dispose" });
    this.#isDisposed = true;
    this.#takeOff();
    this.#colors?.dispose();
    this.onBeforeRender = () => {};
    this.#playback.dispose();
    this.#drawer?.domElement.removeEventListener(RESTORED, this.#useGpu);
    this.#stage?.dispose();
    this.geometry.dispose();
    this.#materials?.dispose();
    if (this.#ownsReel) this.reel.close();
  }

  /** Also when a lost context has come back, without what it held. */
  readonly #useGpu = (): void => {
    this.#renewGeometry();
    let stage: Stage;
    try {
      const renderer = this.#drawer as THREE.WebGLRenderer;
      stage = new GpuStage(renderer, this.#setting, this.geometry);
    } catch {
      return void this.#useCpu(); // the driver refuses
    }
    this.#setStage(stage);
  };

  /** Few need it, so that it is a script of its own. */
  #useCpu(): Promise<void> {
    this.#becomesCpu ??= import("./cpu_stage.js").then(
      ({ CpuStage }) => {
        this.#renewGeometry();
        this.#setStage(new CpuStage(this.#setting, this.geometry));
      },
      (error: Error) => this.#send({ type: "error", error, block: null }),
    );
    return this.#becomesCpu;
  }

  #setStage(stage: Stage): void {
    this.#becomesCpu = null;
    if (this.#isDisposed) return stage.dispose();
    this.#stage?.dispose();
    this.#stage = stage;
    this.#restart(stage);
  }

  #restart(stage: Stage): void {
    this.#colors?.begin(stage, this.#setting.drawing.items);
    this.#playback.restart();
  }

  async #load(number: number, signal: AbortSignal): Promise<BlockFields> {
    const [block, colors] = await Promise.all([
      this.reel.fields(number, { signal }),
      this.#colors?.fields(number, signal),
    ]);
    if (colors) this.#coloring.set(block, colors);
    return block;
  }

  async #setColors(colors: TrackColors | null): Promise<void> {
    if (colors === this.#colors) return;
    this.#colors?.dispose();
    this.#colors = colors;
    const stage = this.#stage;
    if (!stage) return;
    if ((colors?.split ?? null) === this.#split) this.#restart(stage);
    else if (stage.isOnGpu) this.#useGpu();
    else await this.#useCpu();
  }

  /** Has the geometry be such as a new stage and the colours need it. */
  #renewGeometry(): void {
    this.geometry.dispose(); // also buffers of attributes that others take the place of
    const split = this.#colors?.split ?? null;
    if (split === this.#split) return;
    this.#split = split;
    const { surface, info } = this.reel;
    const drawing = drawingOf(surface, info.nVerts, split);
    this.#setting = { ...this.#setting, drawing };
    this.geometry = geometryOf(drawing);
    this.#picked.geometry = new THREE.BufferGeometry();
    this.#boundAll();
  }

  #takeOff(): void {
    this.#wearing?.abort();
    this.#worn?.remove();
    this.#worn = null;
  }

  /** Those of all frames, with what the decoded ones may be off. */
  #boundAll(): void {
    const { info, shift } = this.#setting;
    const radius = info.diagonal * (0.5 + (info.promisePercent ?? UNKNOWN_PERCENT) / 100);
    const sphere = new THREE.Sphere(new THREE.Vector3(...shift), radius);
    this.geometry.boundingSphere = sphere;
    this.geometry.boundingBox = sphere.getBoundingBox(new THREE.Box3());
  }

  /** The same picture with positions that the CPU can read. */
  #shownMesh(): THREE.Mesh {
    const { geometry } = this.#picked;
    if (!geometry.index) {
      const { index, groups, boundingSphere, attributes } = this.geometry;
      // Those in memory that do not change.
      const others = Object.fromEntries(
        this.#setting.drawing.attributes.map(({ name }) => [name, attributes[name]]),
      );
      const position = new THREE.BufferAttribute(new Float32Array(3 * this.sources.length), 3);
      Object.assign(geometry, {
        index,
        groups,
        boundingSphere,
        attributes: { ...others, position },
      });
    }
    if (this.#isPickedStale) {
      this.#stage?.read(geometry.attributes.position.array as Float32Array);
      this.#isPickedStale = false;
    }
    return this.#picked;
  }
}

/** Nothing is drawn of it until there is a picture. */
function geometryOf(drawing: Drawing): THREE.BufferGeometry {
  const geometry = new THREE.BufferGeometry();
  geometry.setIndex(new THREE.BufferAttribute(drawing.index, 1));
  const none = { width: 3, values: new Float32Array(3) }; // until a stage brings its own
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
