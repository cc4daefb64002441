// Sources of textures: addresses, elements, bitmaps and three.js textures.

import * as THREE from "three";

import { InvalidInputError, SourceError } from "../../errors.js";

/** A source of a static texture. */
export type ImageSource = HTMLImageElement | ImageBitmap | THREE.Texture;

/** A source of a texture; a string is an address. */
export type TextureSource = string | HTMLVideoElement | ImageSource;

/** The type of a texture. */
export type TextureKind = "image" | "video";

/** CORS mode, as the attribute `crossorigin` in HTML. */
export type CrossOrigin = "anonymous" | "use-credentials";

const VIDEOS = /\.(mp4|m4v|webm|mov|ogv|mkv)$/i;
const IMAGES = /\.(png|jpe?g|webp|avif|gif|bmp|svg)$/i;

/** Reasons by `MediaError.code`. */
const MEDIA_ERRORS = [
  "",
  "loading was stopped",
  "the connection failed",
  "it cannot be decoded",
  "the video does not exist, or the browser does not support it, or its server does not allow this" +
    " page to read it (Access-Control-Allow-Origin)",
];

/**
 * Return the type of a texture by the file extension of its address.
 *
 * @throws InvalidInputError if the extension is unknown.
 */
export function kindFromAddress(address: string): TextureKind {
  const data = /^data:(image|video)\//i.exec(address);
  if (data) return data[1].toLowerCase() as TextureKind;
  const path = address.replace(/[?#].*$/s, "");
  if (VIDEOS.test(path)) return "video";
  if (IMAGES.test(path)) return "image";
  throw new InvalidInputError(
    `cannot tell from ${address} whether it is an image or a video; set the option kind`,
  );
}

/**
 * Return the type of a texture source.
 *
 * @throws InvalidInputError if it is not supported.
 */
export function kindFromObject(source: Exclude<TextureSource, string>): TextureKind {
  if (source instanceof HTMLVideoElement) return "video";
  if ("isVideoTexture" in source) {
    throw new InvalidInputError("a VideoTexture cannot be synchronized with a mesh; pass its video element");
  }
  const isImage = source instanceof HTMLImageElement || source instanceof ImageBitmap;
  if (isImage || "isTexture" in source) return "image";
  throw new InvalidInputError(
    "a texture source must be an address, an image or video element, an ImageBitmap or a three.js" +
      ` Texture; got ${Object.prototype.toString.call(source)}`,
  );
}

/** Start to load an image. */
export function openImage(address: string, access: CrossOrigin): HTMLImageElement {
  const image = new Image();
  image.crossOrigin = access;
  image.src = address;
  return image;
}

/**
 * Wait until an image is decoded.
 *
 * @throws SourceError if it cannot be loaded or decoded.
 */
export async function waitForImage(image: HTMLImageElement): Promise<void> {
  try {
    await image.decode();
  } catch {
    throw new SourceError(
      `cannot load the image ${image.src}: it does not exist, or the browser does not support it, or` +
        " its server does not allow this page to read it (Access-Control-Allow-Origin)",
    );
  }
  requireReadable(image, image.naturalWidth, `image ${image.currentSrc}`);
}

/**
 * Check that the page may read an image, as textures require, and not only display it.
 *
 * @param width - width of the image, in pixels
 * @throws SourceError if the image is tainted.
 */
export function requireReadable(picture: CanvasImageSource, width: number, name: string): void {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [1, 1];
  const context = canvas.getContext("2d") as CanvasRenderingContext2D;
  context.drawImage(picture, 0, 0, width, width, 0, 0, 1, 1);
  try {
    context.getImageData(0, 0, 1, 1);
  } catch {
    throw new SourceError(
      `this page must not read the ${name}: its server must send Access-Control-Allow-Origin, and` +
        " its element must have the attribute crossorigin",
    );
  }
}

/** Start to load a video. */
export function openVideo(address: string, access: CrossOrigin): HTMLVideoElement {
  const video = document.createElement("video");
  video.crossOrigin = access;
  video.playsInline = true;
  video.preload = "auto";
  video.src = address;
  return video;
}

/**
 * Wait until the size and the duration of a video are known.
 *
 * @throws SourceError if it cannot be loaded; the reason of the signal if that is aborted
 */
export function waitForMetadata(video: HTMLVideoElement, signal: AbortSignal): Promise<void> {
  return new Promise((resolve, reject) => {
    if (video.error) return reject(videoError(video));
    if (video.readyState >= video.HAVE_METADATA) return resolve();
    const cleanup = new AbortController();
    const finish = (settle: () => void) => () => {
      cleanup.abort();
      settle();
    };
    const options = { signal: cleanup.signal };
    video.addEventListener("loadedmetadata", finish(resolve), options);
    video.addEventListener("error", finish(() => reject(videoError(video))), options);
    signal.addEventListener("abort", finish(() => reject(signal.reason)), options);
  });
}

/** Create an error that describes the failure of a video. */
export function videoError(video: HTMLVideoElement): SourceError {
  const { code = 0, message = "" } = video.error ?? {};
  const reason = MEDIA_ERRORS[code] || "unknown reason";
  const name = video.currentSrc || video.src || "without an address";
  return new SourceError(`cannot play the video ${name}: ${reason}${message && ` (${message})`}`);
}

/** Release the connection and the decoded images of a video. */
export function closeVideo(video: HTMLVideoElement): void {
  video.pause();
  video.removeAttribute("src");
  video.load();
}
