// Images of a video as a texture: one is shown, another one may be captured.

import * as THREE from "three";

import { InvalidInputError } from "../../errors.js";
import { type FrameNumber, readFrameNumber, cellsSize } from "./frame_number.js";
import { requireReadable } from "./texture_source.js";

type Context2D = CanvasRenderingContext2D;

/** Timestamps above the first limit that differ from the callback time by less than the second are trusted. */
const [MIN_TIMESTAMP_S, MAX_TIMESTAMP_DEVIATION_S] = [0.02, 0.5];

/**
 * The shown image of a video, and a captured one that waits for its mesh.
 *
 * A video advances concurrently with scripts. Images are therefore copied, so that the frame number
 * and the texture come from the same image.
 */
export class VideoPicture {
  readonly texture: THREE.CanvasTexture;
  #shown = createContext();
  #captured = createContext();
  readonly #cells: { layout: FrameNumber; context: Context2D } | null;
  #hasCaptured = false;
  #isReadable = false;
  /**
   * Whether timestamps of `VideoFrame` are times of the video: known for Chromium, false in Firefox
   * 153, and otherwise detected, which the first image with timestamp 0 does not allow.
   */
  #hasFrameTimestamps = "userAgentData" in navigator;

  /** @param frameNumber - where images encode their frame number; null if they do not */
  constructor(frameNumber: FrameNumber | null) {
    this.#cells = frameNumber && {
      layout: frameNumber,
      context: createContext({ willReadFrequently: true }),
    };
    this.texture = new THREE.CanvasTexture(this.#shown.canvas);
    this.texture.colorSpace = THREE.SRGBColorSpace;
    this.texture.wrapS = this.texture.wrapT = THREE.RepeatWrapping;
    this.texture.generateMipmaps = false; // they would be rebuilt for each image
    this.texture.minFilter = THREE.LinearFilter;
  }

  /**
   * Capture the current image of the video and return its time in seconds.
   *
   * @param timeS - time of the image as reported by the browser
   * @throws SourceError if the page must not read the video.
   * @throws InvalidInputError if the cells of frame numbers are outside of the image.
   */
  capture(video: HTMLVideoElement, timeS: number): number {
    const { videoWidth, videoHeight } = video;
    resize(this.#captured.canvas, videoWidth, videoHeight);
    const videoFrame = captureVideoFrame(video);
    this.#captured.drawImage(videoFrame ?? video, 0, 0, videoWidth, videoHeight);
    const timestampS = videoFrame ? videoFrame.timestamp / 1e6 : NaN;
    videoFrame?.close();
    if (!this.#isReadable) this.#check(video);
    this.#hasCaptured = true;
    const deviationS = Math.abs(timestampS - timeS);
    if (timestampS > MIN_TIMESTAMP_S && deviationS < MAX_TIMESTAMP_DEVIATION_S) {
      this.#hasFrameTimestamps = true;
    }
    return this.#hasFrameTimestamps && !Number.isNaN(timestampS) ? timestampS : timeS;
  }

  /** Whether images encode their frame numbers. */
  get hasFrameNumbers(): boolean {
    return this.#cells !== null;
  }

  /** Read the frame number in the captured image; null if it is unreadable. */
  readNumber(): number | null {
    if (!this.#cells) return null;
    const { layout, context } = this.#cells;
    const { width, height } = cellsSize(layout);
    resize(context.canvas, width, height);
    context.drawImage(
      this.#captured.canvas,
      ...([layout.x, layout.y, width, height] as const),
      ...([0, 0, width, height] as const),
    );
    return readFrameNumber(context.getImageData(0, 0, width, height).data, layout);
  }

  /** Show the captured image; returns false if there is none. */
  show(): boolean {
    if (!this.#hasCaptured) return false;
    this.#hasCaptured = false;
    [this.#shown, this.#captured] = [this.#captured, this.#shown];
    const [{ canvas }, { texture }] = [this.#shown, this];
    const { width, height } = this.#captured.canvas;
    if (canvas.width !== width || canvas.height !== height) texture.dispose(); // it cannot be resized
    texture.image = canvas;
    texture.needsUpdate = true;
    return true;
  }

  /** Discard the captured image. */
  discard(): void {
    this.#hasCaptured = false;
  }

  /** Free the images. */
  dispose(): void {
    this.texture.dispose();
    for (const { canvas } of [this.#shown, this.#captured]) resize(canvas, 0, 0);
  }

  #check({ videoWidth, videoHeight, currentSrc }: HTMLVideoElement): void {
    requireReadable(this.#captured.canvas, videoWidth, `video ${currentSrc}`);
    this.#isReadable = true;
    if (!this.#cells) return;
    const { x, y } = this.#cells.layout;
    const { width, height } = cellsSize(this.#cells.layout);
    if (x + width <= videoWidth && y + height <= videoHeight) return;
    throw new InvalidInputError(
      `cells of ${width} x ${height} pixels at (${x}, ${y}) exceed the video of ` +
        `${videoWidth} x ${videoHeight} pixels`,
    );
  }
}

/**
 * Capture the current image together with its timestamp; on a busy page, separate calls could mix
 * two images. Null if `VideoFrame` is unavailable, as on pages without https.
 */
function captureVideoFrame(video: HTMLVideoElement): VideoFrame | null {
  if (typeof VideoFrame === "undefined") return null;
  try {
    return new VideoFrame(video);
  } catch {
    return null; // there is no image, or the page must not read it, which is reported when drawing
  }
}

function createContext(settings?: CanvasRenderingContext2DSettings): Context2D {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [1, 1];
  return canvas.getContext("2d", settings) as Context2D;
}

/** Resize a canvas, which clears it, only if necessary. */
function resize(canvas: HTMLCanvasElement, width: number, height: number): void {
  if (canvas.width !== width) canvas.width = width;
  if (canvas.height !== height) canvas.height = height;
}
