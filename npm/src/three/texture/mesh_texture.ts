// Shows an image or a video on a mesh. Loaded with the first `setTexture`.

import * as THREE from "three";

import { InvalidInputError } from "../../errors.js";
import { hasMap, type MappedMaterial, overrideMaterial } from "../material_override.js";
import type { MeshSegment } from "../mesh_segment.js";
import type { Playback, PlaybackEvent } from "../playback.js";
import {
  closeVideo,
  type CrossOrigin,
  openImage,
  type TextureKind,
  kindFromAddress,
  kindFromObject,
  waitForImage,
  waitForMetadata,
  openVideo,
  type ImageSource,
  type TextureSource,
} from "./texture_source.js";
import { VideoClock } from "./video_clock.js";
import { VideoPicture } from "./video_picture.js";

/** Options of `ReelMesh.setTexture`. */
export interface TextureOptions {
  /** Type of the resource, if the file extension of the address does not tell. */
  kind?: TextureKind;
  /** CORS mode of requests to other origins. Default: "anonymous". */
  crossOrigin?: CrossOrigin;
  /** Name of the UV attribute. Default: the first one of the file. */
  uv?: string;
  /** Time of the video at the first frame of the mesh, in seconds. Default: 0. */
  offset?: number;
  /** Whether a video starts without sound, which browsers need to start it by themselves. */
  muted?: boolean;
}

/** The mesh that gets a texture. */
export interface TexturedMesh {
  /** Segments in memory, which change. */
  readonly segments: ReadonlyMap<number, MeshSegment>;
  /** The shown segment. */
  readonly current: MeshSegment;
  readonly material: THREE.Material | THREE.Material[];
  readonly playback: Playback;
  readonly send: (event: PlaybackEvent) => void;
}

/** A texture on a mesh. */
export interface AppliedTexture {
  readonly texture: THREE.Texture;
  readonly video: HTMLVideoElement | null;
  /** Show it on another segment. */
  add(segment: MeshSegment): void;
  /** Forget the materials of a segment that is disposed of. */
  remove(segment: MeshSegment): void;
  /** Restore all materials, and free its resources. */
  dispose(): void;
}

/**
 * Show a texture on a mesh. The promise resolves when an image is shown; a video is shown as soon
 * as its first image and the frame of the mesh are available.
 *
 * @param signal - cancels the call and frees its resources
 * @throws InvalidInputError, SourceError as `ReelMesh.setTexture`
 */
export async function applyTexture(
  mesh: TexturedMesh,
  source: TextureSource,
  options: TextureOptions,
  signal: AbortSignal,
): Promise<AppliedTexture> {
  const { materials, drawing } = mesh.current;
  const channel = findChannel(drawing.uvNames, options.uv);
  const kind = validateOptions(source, options);
  const { crossOrigin = "anonymous" } = options;
  await materials?.loadImages();
  signal.throwIfAborted();
  if (kind === "video") {
    const isOwned = typeof source === "string";
    const video = isOwned ? openVideo(source, crossOrigin) : (source as HTMLVideoElement);
    if (options.muted) video.muted = true;
    try {
      await waitForMetadata(video, signal);
      return applyVideo(mesh, video, channel, options, isOwned);
    } catch (error) {
      if (isOwned) closeVideo(video);
      throw error;
    }
  }
  const image = typeof source === "string" ? openImage(source, crossOrigin) : source;
  if (image instanceof HTMLImageElement) await waitForImage(image);
  signal.throwIfAborted();
  return applyImage(mesh, image as ImageSource, channel);
}

function findChannel(uvNames: readonly string[], requested: string | undefined): number {
  if (!uvNames.length) {
    throw new InvalidInputError(
      "the file has no UVs, which textures need; encode the mesh with its UVs",
    );
  }
  if (requested === undefined) return 0;
  const channel = uvNames.indexOf(requested);
  if (channel >= 0) return channel;
  throw new InvalidInputError(
    `the file has no UV attribute ${requested}; available: ${uvNames.join(", ")}`,
  );
}

/** Return the type of a source. @throws InvalidInputError for options without effect on it. */
function validateOptions(source: TextureSource, options: TextureOptions): TextureKind {
  const isAddress = typeof source === "string";
  const kind = isAddress ? (options.kind ?? kindFromAddress(source)) : kindFromObject(source);
  const reject = (name: keyof TextureOptions, what: string) => {
    if (options[name] !== undefined) throw new InvalidInputError(`${name} applies only to ${what}`);
  };
  if (!isAddress) {
    reject("kind", "addresses");
    reject("crossOrigin", "addresses");
  }
  if (kind === "image") reject("offset", "videos");
  const { offset = 0 } = options;
  if (Number.isFinite(offset)) return kind;
  throw new InvalidInputError(`offset must be a finite number of seconds; got ${offset}`);
}

function applyImage(mesh: TexturedMesh, source: ImageSource, channel: number): AppliedTexture {
  const isOwned = !("isTexture" in source);
  const texture = isOwned ? createImageTexture(source) : source;
  const materialOverride = new MaterialOverride(texture, mesh);
  const previousChannel = texture.channel;
  texture.channel = channel;
  materialOverride.apply();
  const dispose = () => {
    materialOverride.dispose();
    if (isOwned) texture.dispose();
    else texture.channel = previousChannel;
  };
  return { texture, video: null, ...followSegments(mesh, materialOverride, channel), dispose };
}

/** Create a texture with the top edge at v = 1, as for images of the file. */
function createImageTexture(image: HTMLImageElement | ImageBitmap): THREE.Texture {
  const texture = new THREE.Texture(image);
  texture.colorSpace = THREE.SRGBColorSpace;
  texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
  if (image instanceof ImageBitmap) {
    texture.flipY = false; // WebGL ignores flipY for bitmaps
    texture.repeat.y = -1;
    texture.offset.y = 1;
  }
  texture.needsUpdate = true;
  return texture;
}

function applyVideo(
  mesh: TexturedMesh,
  video: HTMLVideoElement,
  channel: number,
  { offset = 0 }: TextureOptions,
  isOwned: boolean,
): AppliedTexture {
  const picture = new VideoPicture();
  const { texture } = picture;
  texture.channel = channel;
  const materialOverride = new MaterialOverride(texture, mesh);
  const { playback, send } = mesh;
  const onShown = () => materialOverride.apply();
  const videoClock = new VideoClock({ video, picture, playback, offset, send, onShown });
  const dispose = () => {
    videoClock.dispose();
    materialOverride.dispose();
    picture.dispose();
    if (isOwned) closeVideo(video);
  };
  return { texture, video, ...followSegments(mesh, materialOverride, channel), dispose };
}

/** Shows a texture on all materials that have a map: those of segments, or those that the page uses. */
class MaterialOverride {
  readonly #texture: THREE.Texture;
  readonly #segments: TexturedMesh["segments"];
  #materials: readonly MappedMaterial[];
  #isApplied = false;
  readonly #restore = new Map<THREE.Material, () => void>();

  /** @throws InvalidInputError if no material has a map. */
  constructor(texture: THREE.Texture, { segments, current, material }: TexturedMesh) {
    this.#texture = texture;
    this.#segments = segments;
    const isOwn = material === current.material;
    const own = [...segments.values()].flatMap(({ materials }) => materials?.list ?? []);
    this.#materials = (isOwn ? own : [material].flat()).filter(hasMap);
    if (this.#materials.length) return;
    throw new InvalidInputError(
      "no material of the mesh can show a texture: none has a map; use one such as" +
        " MeshStandardMaterial",
    );
  }

  /** Apply the texture to the materials. */
  apply(): void {
    if (!this.#isApplied) this.#override(this.#materials);
    this.#isApplied = true;
  }

  /** Include further materials. */
  add(materials: readonly THREE.Material[]): void {
    const added = materials.filter(hasMap).filter((material) => !this.#materials.includes(material));
    this.#materials = [...this.#materials, ...added];
    if (this.#isApplied) this.#override(added);
  }

  /** Forget materials, without restoring them. */
  remove(materials: readonly THREE.Material[]): void {
    this.#materials = this.#materials.filter((material) => !materials.includes(material));
    for (const material of materials) this.#restore.delete(material);
  }

  /** Restore all materials. */
  dispose(): void {
    for (const restore of this.#restore.values()) restore();
    this.#restore.clear();
  }

  /** The colors of materials tint the texture, except for those of default materials. */
  #override(materials: readonly MappedMaterial[]): void {
    for (const material of materials) {
      const isDefault = this.#isDefault(material);
      const properties = { map: this.#texture, ...(isDefault && { vertexColors: false }) };
      this.#restore.set(material, overrideMaterial(material, properties, isDefault));
    }
  }

  /** Whether a material is that of faces for which the file defines none. */
  #isDefault(material: THREE.Material): boolean {
    return [...this.#segments.values()].some(({ drawing, materials, reel }) => {
      const name = drawing.materialNames[materials?.list.indexOf(material as never) ?? -1];
      return name !== undefined && !reel.surface.materials.some((defined) => defined.name === name);
    });
  }
}

/** Return how the texture follows changes of segments; reports those in memory that lack its UVs. */
function followSegments(
  { segments, current, send }: TexturedMesh,
  override: MaterialOverride,
  channel: number,
): Pick<AppliedTexture, "add" | "remove"> {
  const add = ({ number, drawing, materials }: MeshSegment) => {
    if (!materials) return; // the page provides the material
    if (channel < drawing.uvNames.length) return override.add(materials.list);
    const error = new InvalidInputError(`segment ${number} has no UVs, which the texture needs`);
    send({ type: "error", error, block: null });
  };
  for (const segment of segments.values()) if (segment !== current) add(segment);
  return { add, remove: ({ materials }) => override.remove(materials?.list ?? []) };
}
