// Pictures of a video as a texture: one is shown, another may be ready to be.

import * as THREE from "three";

import { InvalidInputError } from "../../errors.js";
import { type FrameNumber, numberIn, sizeOf } from "./frame_number.js";
import { requireReadable } from "./texture_source.js";

type Pen = CanvasRenderingContext2D;

/** Times that mean nothing are up to the first, or farther than the other from what is told. */
const [EARLY_S, NEAR_S] = [0.02, 0.5];

/**
 * The picture of a video that is shown, and one that was taken and waits for its mesh.
 *
 * A video goes on by itself, also between two lines of a script. Hence a picture is copied when it
 * is taken, so that what is read in it and what the texture shows is one picture.
 */
export class VideoPicture {
  readonly texture: THREE.CanvasTexture;
  #shown = pen();
  #taken = pen();
  readonly #cells: { at: FrameNumber; pen: Pen } | null;
  #isWaiting = false;
  #isReadable = false;
  /**
   * Whether stills of the video have its times: in Chromium they do, also at the first picture,
   * whose time tells nothing; in Firefox 153 not.
   */
  #areStillsTimed = "userAgentData" in navigator;

  /** @param frameNumber - where pictures hold their numbers; null if they do not */
  constructor(frameNumber: FrameNumber | null) {
    this.#cells = frameNumber && { at: frameNumber, pen: pen({ willReadFrequently: true }) };
    this.texture = new THREE.CanvasTexture(this.#shown.canvas);
    this.texture.colorSpace = THREE.SRGBColorSpace;
    this.texture.wrapS = this.texture.wrapT = THREE.RepeatWrapping;
    this.texture.generateMipmaps = false; // they would be made anew for each picture
    this.texture.minFilter = THREE.LinearFilter;
  }

  /**
   * Takes the picture that the video shows now, and gives its time in seconds.
   *
   * @param timeS - of the picture, as the browser says
   * @throws SourceError where the page may not read the video.
   * @throws InvalidInputError where the cells of numbers lie outside of it.
   */
  take(video: HTMLVideoElement, timeS: number): number {
    const { videoWidth, videoHeight } = video;
    fit(this.#taken.canvas, videoWidth, videoHeight);
    const still = stillOf(video);
    this.#taken.drawImage(still ?? video, 0, 0, videoWidth, videoHeight);
    const stillS = still ? still.timestamp / 1e6 : NaN;
    still?.close();
    if (!this.#isReadable) this.#check(video);
    this.#isWaiting = true;
    if (stillS > EARLY_S && Math.abs(stillS - timeS) < NEAR_S) this.#areStillsTimed = true;
    return this.#areStillsTimed && !Number.isNaN(stillS) ? stillS : timeS;
  }

  /** Whether pictures hold the numbers of their frames. */
  get isNumbered(): boolean {
    return this.#cells !== null;
  }

  /** The number of the frame in the picture that was taken; null where it cannot be read. */
  readNumber(): number | null {
    if (!this.#cells) return null;
    const { at, pen } = this.#cells;
    const { width, height } = sizeOf(at);
    fit(pen.canvas, width, height);
    pen.drawImage(this.#taken.canvas, at.x, at.y, width, height, 0, 0, width, height);
    return numberIn(pen.getImageData(0, 0, width, height).data, at);
  }

  /** Shows the picture that was taken; false where none was since the last one. */
  show(): boolean {
    if (!this.#isWaiting) return false;
    this.#isWaiting = false;
    [this.#shown, this.#taken] = [this.#taken, this.#shown];
    const [{ canvas }, { texture }] = [this.#shown, this];
    const { width, height } = this.#taken.canvas;
    if (canvas.width !== width || canvas.height !== height) texture.dispose(); // is made anew
    texture.image = canvas;
    texture.needsUpdate = true;
    return true;
  }

  /** Forgets the picture that was taken. */
  drop(): void {
    this.#isWaiting = false;
  }

  /** Frees the pictures. */
  dispose(): void {
    this.texture.dispose();
    for (const { canvas } of [this.#shown, this.#taken]) fit(canvas, 0, 0);
  }

  #check({ videoWidth, videoHeight, currentSrc }: HTMLVideoElement): void {
    requireReadable(this.#taken.canvas, videoWidth, `video ${currentSrc}`);
    this.#isReadable = true;
    if (!this.#cells) return;
    const { x, y } = this.#cells.at;
    const { width, height } = sizeOf(this.#cells.at);
    if (x + width <= videoWidth && y + height <= videoHeight) return;
    throw new InvalidInputError(
      `cells of ${width} x ${height} pixels at (${x}, ${y}) do not lie in a video of ` +
        `${videoWidth} x ${videoHeight}`,
    );
  }
}

/**
 * A still of a video: its picture and the time of that, where a busy page would get the time of one
 * picture and the pixels of the next. Null where there are none, as on pages without https.
 */
function stillOf(video: HTMLVideoElement): VideoFrame | null {
  if (typeof VideoFrame === "undefined") return null;
  try {
    return new VideoFrame(video);
  } catch {
    return null; // it has no picture now, or may not be read, which is told where it is read
  }
}

function pen(settings?: CanvasRenderingContext2DSettings): Pen {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [1, 1];
  return canvas.getContext("2d", settings) as Pen;
}

/** Keeps what is drawn where the size is the same. */
function fit(canvas: HTMLCanvasElement, width: number, height: number): void {
  if (canvas.width !== width) canvas.width = width;
  if (canvas.height !== height) canvas.height = height;
}
