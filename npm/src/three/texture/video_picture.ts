// Images of a video as a texture: one is shown, another one may be captured.

import * as THREE from "three";

import { requireReadable } from "./texture_source.js";

type Context2D = CanvasRenderingContext2D;

/** Timestamps above the first limit that differ from the callback time by less than the second are trusted. */
const [MIN_TIMESTAMP_S, MAX_TIMESTAMP_DEVIATION_S] = [0.02, 0.5];

/**
 * The shown image of a video, and a captured one that waits for its mesh.
 *
 * A video advances concurrently with scripts. Images are therefore copied, so that the time and the
 * texture come from the same image.
 */
export class VideoPicture {
  readonly texture: THREE.CanvasTexture;
  #shown = createContext();
  #captured = createContext();
  #hasCaptured = false;
  #isReadable = false;
  /**
   * Whether timestamps of `VideoFrame` are times of the video: known for Chromium, false in Firefox
   * 153, and otherwise detected, which the first image with timestamp 0 does not allow.
   */
  #hasFrameTimestamps = "userAgentData" in navigator;

  constructor() {
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
   */
  capture(video: HTMLVideoElement, timeS: number): number {
    const { videoWidth, videoHeight } = video;
    resize(this.#captured.canvas, videoWidth, videoHeight);
    const videoFrame = captureVideoFrame(video);
    this.#captured.drawImage(videoFrame ?? video, 0, 0, videoWidth, videoHeight);
    const timestampS = videoFrame ? videoFrame.timestamp / 1e6 : NaN;
    videoFrame?.close();
    if (!this.#isReadable) requireReadable(this.#captured.canvas, videoWidth, `video ${video.currentSrc}`);
    this.#isReadable = true;
    this.#hasCaptured = true;
    const deviationS = Math.abs(timestampS - timeS);
    if (timestampS > MIN_TIMESTAMP_S && deviationS < MAX_TIMESTAMP_DEVIATION_S) {
      this.#hasFrameTimestamps = true;
    }
    return this.#hasFrameTimestamps && !Number.isNaN(timestampS) ? timestampS : timeS;
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

function createContext(): Context2D {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [1, 1];
  return canvas.getContext("2d") as Context2D;
}

/** Resize a canvas, which clears it, only if necessary. */
function resize(canvas: HTMLCanvasElement, width: number, height: number): void {
  if (canvas.width !== width) canvas.width = width;
  if (canvas.height !== height) canvas.height = height;
}
