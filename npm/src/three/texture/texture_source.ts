// What textures are made of: addresses, elements, bitmaps, textures of three.js.

import * as THREE from "three";

import { InvalidInputError, SourceError } from "../../errors.js";

/** What stands still. */
export type StillSource = HTMLImageElement | ImageBitmap | THREE.Texture;

/** What a texture can be made of; a string is an address. */
export type TextureSource = string | HTMLVideoElement | StillSource;

/** What is at an address. */
export type Kind = "image" | "video";

/** Who may see what comes from another site; see `crossorigin` of HTML. */
export type CrossOrigin = "anonymous" | "use-credentials";

const VIDEOS = /\.(mp4|m4v|webm|mov|ogv|mkv)$/i;
const IMAGES = /\.(png|jpe?g|webp|avif|gif|bmp|svg)$/i;

/** By `MediaError.code`. */
const MEDIA_ERRORS = [
  "",
  "loading was stopped",
  "the connection failed",
  "it cannot be decoded",
  "there is no such video, or this browser does not play it, or its server does not allow this page" +
    " to read it (Access-Control-Allow-Origin)",
];

/**
 * What is at an address, as its name says.
 *
 * @throws InvalidInputError where it does not say so.
 */
export function kindOf(address: string): Kind {
  const data = /^data:(image|video)\//i.exec(address);
  if (data) return data[1].toLowerCase() as Kind;
  const path = address.replace(/[?#].*$/s, "");
  if (VIDEOS.test(path)) return "video";
  if (IMAGES.test(path)) return "image";
  throw new InvalidInputError(
    `the name ${address} does not say whether it is an image or a video; say so with kind`,
  );
}

/**
 * What an object is.
 *
 * @throws InvalidInputError where textures are not made of it.
 */
export function kindOfObject(source: Exclude<TextureSource, string>): Kind {
  if (source instanceof HTMLVideoElement) return "video";
  if ("isVideoTexture" in source) {
    throw new InvalidInputError("a VideoTexture is not in step with a mesh; give its video");
  }
  const isImage = source instanceof HTMLImageElement || source instanceof ImageBitmap;
  if (isImage || "isTexture" in source) return "image";
  throw new InvalidInputError(
    "a texture is made of an address, an image or video element, an ImageBitmap or a Texture of" +
      ` three.js; got ${Object.prototype.toString.call(source)}`,
  );
}

/** An image of an address, which begins to load. */
export function imageOf(address: string, access: CrossOrigin): HTMLImageElement {
  const image = new Image();
  image.crossOrigin = access;
  image.src = address;
  return image;
}

/**
 * Waits until an image is there.
 *
 * @throws SourceError where there is none that can be shown.
 */
export async function loaded(image: HTMLImageElement): Promise<void> {
  try {
    await image.decode();
  } catch {
    throw new SourceError(
      `cannot load the image ${image.src}: there is no such image, or this browser does not show` +
        " it, or its server does not allow this page to read it (Access-Control-Allow-Origin)",
    );
  }
  requireReadable(image, image.naturalWidth, `image ${image.currentSrc}`);
}

/**
 * Refuses what a page may show, but not read, since textures are read.
 *
 * @param width - of the picture, in pixels
 * @throws SourceError where it may not be read.
 */
export function requireReadable(picture: CanvasImageSource, width: number, name: string): void {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [1, 1];
  const pen = canvas.getContext("2d") as CanvasRenderingContext2D;
  pen.drawImage(picture, 0, 0, width, width, 0, 0, 1, 1);
  try {
    pen.getImageData(0, 0, 1, 1);
  } catch {
    throw new SourceError(
      `this page may not read the ${name}: its server has to allow it by` +
        " Access-Control-Allow-Origin, and its element has to have the attribute crossorigin",
    );
  }
}

/** A video of an address, which begins to load. */
export function openVideo(address: string, access: CrossOrigin): HTMLVideoElement {
  const video = document.createElement("video");
  video.crossOrigin = access;
  video.playsInline = true;
  video.preload = "auto";
  video.src = address;
  return video;
}

/**
 * Waits until the size and the length of a video are known.
 *
 * @throws SourceError where it cannot be had; the reason of the signal, if that is aborted
 */
export function metadataOf(video: HTMLVideoElement, signal: AbortSignal): Promise<void> {
  return new Promise((resolve, reject) => {
    if (video.error) return reject(videoError(video));
    if (video.readyState >= video.HAVE_METADATA) return resolve();
    const end = new AbortController();
    const over = (settle: () => void) => () => {
      end.abort();
      settle();
    };
    const listen = { signal: end.signal };
    video.addEventListener("loadedmetadata", over(resolve), listen);
    video.addEventListener("error", over(() => reject(videoError(video))), listen);
    signal.addEventListener("abort", over(() => reject(signal.reason)), listen);
  });
}

/** What is wrong with a video, in words. */
export function videoError(video: HTMLVideoElement): SourceError {
  const { code = 0, message = "" } = video.error ?? {};
  const reason = MEDIA_ERRORS[code] || "no reason is given";
  const name = video.currentSrc || video.src || "without an address";
  return new SourceError(`cannot play the video ${name}: ${reason}${message && ` (${message})`}`);
}

/** Lets go what a video holds: its connection and decoded pictures. */
export function closeVideo(video: HTMLVideoElement): void {
  video.pause();
  video.removeAttribute("src");
  video.load();
}
