// The image or video that a mesh shows in place of the images of its file.

import * as THREE from "three";

import { InvalidInputError } from "../../errors.js";
import type { Playback, PlaybackEvent } from "../playback.js";
import { Cover } from "./cover.js";
import { checkFrameNumber, type FrameNumber } from "./frame_number.js";
import {
  closeVideo,
  type CrossOrigin,
  imageOf,
  type Kind,
  kindOf,
  kindOfObject,
  loaded,
  metadataOf,
  openVideo,
  type StillSource,
  type TextureSource,
} from "./texture_source.js";
import { VideoLeader } from "./video_leader.js";
import { VideoPicture } from "./video_picture.js";

/** How a texture is put on a mesh. */
export interface TextureOptions {
  /** What is at an address whose name does not say so by its ending. */
  kind?: Kind;
  /** How another site is asked for what is at an address; "anonymous" by default. */
  crossOrigin?: CrossOrigin;
  /** Name of the texture coordinates of the file; the first ones by default. */
  uv?: string;
  /** Time of the video at the first frame of the mesh, in seconds; 0 by default. */
  offset?: number;
  /**
   * Where each picture of the video holds the number of its frame, which then counts more than the
   * time of the video.
   */
  frameNumber?: FrameNumber;
}

/** What a texture is put on. */
export interface TexturedMesh {
  readonly materials: readonly THREE.Material[];
  /** Whether colours of a material are not those of the file or of the page. */
  readonly isPlain: (material: THREE.Material) => boolean;
  /** When the images of the file are there, if it has any. */
  readonly dressed: Promise<unknown> | undefined;
  /** Names of texture coordinates, by channel. */
  readonly uvNames: readonly string[];
  readonly playback: Playback;
  readonly send: (event: PlaybackEvent) => void;
}

/** A texture that is on a mesh. */
export interface WornTexture {
  readonly texture: THREE.Texture;
  readonly video: HTMLVideoElement | null;
  /** Takes it off. */
  remove(): void;
}

/**
 * Puts a texture on a mesh. It is there when the promise is kept; of a video, as soon as its first
 * picture and the frame of the mesh are.
 *
 * @param signal - aborts it; what was made is freed then
 * @throws InvalidInputError, SourceError as `ReelMesh.setTexture` says
 */
export async function wear(
  mesh: TexturedMesh,
  source: TextureSource,
  options: TextureOptions,
  signal: AbortSignal,
): Promise<WornTexture> {
  const channel = channelOf(mesh.uvNames, options.uv);
  const kind = checked(source, options);
  const { crossOrigin = "anonymous" } = options;
  await mesh.dressed;
  signal.throwIfAborted();
  if (kind === "video") {
    const isOwn = typeof source === "string";
    const video = isOwn ? openVideo(source, crossOrigin) : (source as HTMLVideoElement);
    try {
      await metadataOf(video, signal);
      return wearVideo(mesh, video, channel, options, isOwn);
    } catch (error) {
      if (isOwn) closeVideo(video);
      throw error;
    }
  }
  const image = typeof source === "string" ? imageOf(source, crossOrigin) : source;
  if (image instanceof HTMLImageElement) await loaded(image);
  signal.throwIfAborted();
  return wearImage(mesh, image as StillSource, channel);
}

function channelOf(uvNames: readonly string[], wanted: string | undefined): number {
  if (!uvNames.length) {
    throw new InvalidInputError(
      "the file has no texture coordinates, so that no texture can be shown; encode the mesh" +
        " with its UVs",
    );
  }
  if (wanted === undefined) return 0;
  const channel = uvNames.indexOf(wanted);
  if (channel >= 0) return channel;
  throw new InvalidInputError(
    `the file has no texture coordinates ${wanted}; it has ${uvNames.join(", ")}`,
  );
}

/** What a source is; options that would have no effect on it are refused. */
function checked(source: TextureSource, options: TextureOptions): Kind {
  const isAddress = typeof source === "string";
  const kind = isAddress ? (options.kind ?? kindOf(source)) : kindOfObject(source);
  const refuse = (name: keyof TextureOptions, what: string) => {
    if (options[name] !== undefined) throw new InvalidInputError(`${name} is for ${what} only`);
  };
  if (!isAddress) {
    refuse("kind", "addresses");
    refuse("crossOrigin", "addresses");
  }
  if (kind === "image") {
    refuse("offset", "videos");
    refuse("frameNumber", "videos");
  }
  if (options.frameNumber) checkFrameNumber(options.frameNumber);
  const { offset = 0 } = options;
  if (Number.isFinite(offset)) return kind;
  throw new InvalidInputError(`offset must be a finite number of seconds; got ${offset}`);
}

function wearImage(mesh: TexturedMesh, source: StillSource, channel: number): WornTexture {
  const isOwn = !("isTexture" in source);
  const texture = isOwn ? textureOf(source) : source;
  const cover = new Cover(texture, mesh.materials, mesh.isPlain);
  const before = texture.channel;
  texture.channel = channel;
  cover.put();
  const remove = () => {
    cover.remove();
    if (isOwn) texture.dispose();
    else texture.channel = before;
  };
  return { texture, video: null, remove };
}

/** With the upper edge at v = 1, as images of files are. */
function textureOf(image: HTMLImageElement | ImageBitmap): THREE.Texture {
  const texture = new THREE.Texture(image);
  texture.colorSpace = THREE.SRGBColorSpace;
  texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
  if (image instanceof ImageBitmap) {
    texture.flipY = false; // WebGL does not turn bitmaps over
    texture.repeat.y = -1;
    texture.offset.y = 1;
  }
  texture.needsUpdate = true;
  return texture;
}

function wearVideo(
  mesh: TexturedMesh,
  video: HTMLVideoElement,
  channel: number,
  { offset = 0, frameNumber }: TextureOptions,
  isOwn: boolean,
): WornTexture {
  const picture = new VideoPicture(frameNumber ?? null);
  const { texture } = picture;
  texture.channel = channel;
  const cover = new Cover(texture, mesh.materials, mesh.isPlain);
  const { playback, send } = mesh;
  const onShown = () => cover.put();
  const leader = new VideoLeader({ video, picture, playback, offset, send, onShown });
  const remove = () => {
    leader.dispose();
    cover.remove();
    picture.dispose();
    if (isOwn) closeVideo(video);
  };
  return { texture, video, remove };
}
