// A video as master clock: the mesh shows the frame that belongs to the displayed image.

import { InvalidInputError, MeshReelError } from "../../errors.js";
import type { ClockSettings } from "../clock.js";
import type { MasterClock, Playback, PlaybackEvent } from "../playback.js";
import { commonLength, frameAtTime, seekTime } from "./frame_times.js";
import { videoError } from "./texture_source.js";
import type { VideoPicture } from "./video_picture.js";

/** Tolerance for comparing times of the video. */
const TIME_TOLERANCE_S = 1e-3;

/** Tolerance for comparing times of the page. */
const TIME_TOLERANCE_MS = 1;

/** For this long after a seek, Gecko may display another image than it reports. */
const GECKO_SETTLING_MS = 100;

/**
 * After a seek, browsers call back with the displayed image, but not always if it was displayed
 * before. Without a callback for this long, the time of the video determines the image.
 */
const FRAME_CALLBACK_TIMEOUT_MS = 250;

/** Options of a `VideoClock`. */
export interface VideoClockOptions {
  readonly video: HTMLVideoElement;
  readonly picture: VideoPicture;
  readonly playback: Playback;
  /** Time of the video at the first frame of the mesh, in seconds. */
  readonly offset: number;
  readonly send: (event: PlaybackEvent) => void;
  /** Called when an image is shown. */
  readonly onShown: () => void;
}

/**
 * Synchronizes a mesh and a video in both directions: methods of the mesh control the video, and
 * the mesh follows changes of the video, such as by its own controls.
 */
export class VideoClock implements MasterClock {
  readonly #options: VideoClockOptions;
  picture: MasterClock["picture"] = "pending";
  readonly #listeners = new AbortController();
  /** Time to which the video is seeking; null once it arrived, or if others made it seek elsewhere. */
  #targetTime: number | null = null;
  /** Position to seek to after the pending seek. */
  #queuedPosition: number | null = null;
  #isBlocked = false;
  #isStalled = false;
  #hasWarned = false;
  readonly #wasLooping: boolean;
  #callbackId: number | null = null;
  #timeout: ReturnType<typeof setTimeout> | undefined;
  #lastTime: number | null = null;
  /** Time of an image that was announced but is not displayed yet. */
  #announcedTime: number | null = null;
  /** Time of the page from which callbacks report the displayed image, after a seek. */
  #settledMs = 0;

  /**
   * The duration of the video must be known.
   *
   * @throws InvalidInputError if the mesh plays backwards, or the video does not support its speed.
   */
  constructor(options: VideoClockOptions) {
    this.#options = options;
    const { video, playback } = options;
    this.#attach();
    this.#wasLooping = video.loop;
    if (video.loop) playback.clock.loop = true;
    video.loop = false; // the mesh handles loops
    this.#listen();
    this.#requestCallback();
    if (video.paused) this.seek(playback.clock.position);
    if (!video.paused && !playback.isPlaying) playback.play();
    else if (video.paused && playback.isPlaying) this.play();
  }

  show(): boolean {
    const isNewPicture = this.#options.picture.show();
    if (isNewPicture) this.#options.onShown();
    return isNewPicture;
  }

  play(): void {
    if (this.#isBlocked) return;
    const { video, playback, send } = this.#options;
    video.play().catch((error: DOMException) => {
      if (error.name !== "NotAllowedError") return; // interrupted by a pause, or reported by the event "error"
      playback.pause();
      const message =
        "the browser blocks videos with sound until the user clicks or presses a key: call play()" +
          " then, or mute the video";
      send({ type: "warning", message });
    });
  }

  pause(): void {
    this.#options.video.pause();
  }

  seek(position: number): void {
    this.#expectPicture();
    if (this.#targetTime !== null && this.#options.video.seeking) this.#queuedPosition = position;
    else this.#seekVideo(position);
  }

  change({ loop, speed }: Partial<ClockSettings>): void {
    const isBackward = speed !== undefined && speed < 0;
    if (loop === "pingpong" || isBackward) {
      const what = isBackward ? `the speed ${speed}` : 'the loop "pingpong"';
      throw new InvalidInputError(`videos play only forwards; got ${what}`);
    }
    if (speed === undefined) return;
    try {
      this.#options.video.playbackRate = speed;
    } catch {
      throw new InvalidInputError(
        `this browser does not play videos at speed ${speed}; most support 0.0625 to 16`,
      );
    }
  }

  setBlocked(isBlocked: boolean): void {
    if (this.#isBlocked === isBlocked) return;
    this.#isBlocked = isBlocked;
    const { video, playback } = this.#options;
    if (isBlocked) video.pause();
    else if (playback.isPlaying && !video.ended) this.play();
  }

  /** Without frame callbacks, poll the time of the video. */
  update(): void {
    const { video } = this.#options;
    if (this.#callbackId !== null || video.readyState < video.HAVE_CURRENT_DATA) return;
    if (!this.#isSeeking() && video.currentTime !== this.#lastTime) this.#capture(video.currentTime);
  }

  /** Stop synchronizing; the mesh and the video keep their state. */
  dispose(): void {
    const { video, playback } = this.#options;
    this.#listeners.abort();
    this.#announcedTime = null;
    clearTimeout(this.#timeout);
    if (this.#callbackId !== null) video.cancelVideoFrameCallback(this.#callbackId);
    video.loop = this.#wasLooping;
    playback.setMasterClock(null);
    if (playback.isWaiting) playback.show();
  }

  /** Drive the frames that mesh and video have in common. */
  #attach(): void {
    const { video, playback, offset, send } = this.#options;
    const common = commonLength(playback.nFrames, playback.clock.fps, video.duration - offset);
    playback.setMasterClock(this, common.nFrames);
    if (!common.warning || this.#hasWarned) return;
    this.#hasWarned = true;
    send({ type: "warning", message: common.warning });
  }

  #listen(): void {
    const { video, playback } = this.#options;
    const on = (types: string, listener: () => void) => {
      for (const type of types.split(" ")) {
        video.addEventListener(type, listener, { signal: this.#listeners.signal });
      }
    };
    // Events are asynchronous: ignore those that are outdated or that this class caused.
    on("play", () => {
      if (video.paused) return;
      if (this.#isBlocked) video.pause();
      else if (!playback.isPlaying) playback.play();
    });
    on("pause", () => {
      if (video.paused && !video.ended && !this.#isBlocked && playback.isPlaying) playback.pause();
    });
    on("ended", () => {
      if (video.ended && playback.isPlaying) this.#finish();
    });
    on("seeking", () => {
      const target = this.#targetTime;
      const isOwn = target !== null && Math.abs(video.currentTime - target) < TIME_TOLERANCE_S;
      if (!isOwn) this.#onExternalSeek();
    });
    on("seeked", () => this.#onSeeked());
    on("ratechange", () => {
      playback.clock.speed = video.playbackRate;
    });
    on("durationchange", () => this.#attach());
    on("waiting", () => {
      if (!video.paused && !this.#isSeeking() && this.picture === "captured") this.#setStalled(true);
    });
    on("canplay playing", () => {
      if (this.#isStalled) this.#setStalled(false);
    });
    on("error", () => this.#reportError(videoError(video)));
  }

  #requestCallback(): void {
    const { video } = this.#options;
    if (!("requestVideoFrameCallback" in video)) return;
    this.#callbackId = video.requestVideoFrameCallback((now, { mediaTime, expectedDisplayTime }) => {
      this.#requestCallback();
      if (this.#isSeeking()) return;
      if (!announcesFrames(video)) return this.#capture(mediaTime);
      if (this.#announcedTime !== null && now >= this.#settledMs) this.#capture(this.#announcedTime);
      const dueMs = Math.max(expectedDisplayTime, this.#settledMs);
      if (dueMs - now < TIME_TOLERANCE_MS) return this.#capture(mediaTime);
      this.#announcedTime = mediaTime;
      const check = (refresh: number) => {
        if (this.#announcedTime !== mediaTime || this.#isSeeking()) return;
        if (dueMs - refresh < TIME_TOLERANCE_MS) this.#capture(mediaTime);
        else requestAnimationFrame(check);
      };
      requestAnimationFrame(check);
    });
  }

  /** Whether the video is seeking, so that its image is not the requested one. */
  #isSeeking(): boolean {
    return this.#options.video.seeking || this.#queuedPosition !== null;
  }

  /** Capture the displayed image, whose time is `timeS`, and make the mesh follow. */
  #capture(timeS: number): void {
    const { video, picture, playback, offset } = this.#options;
    clearTimeout(this.#timeout);
    this.#announcedTime = null;
    this.#lastTime = timeS;
    let shownS: number;
    try {
      shownS = picture.capture(video, timeS);
    } catch (error) {
      return this.#reportError(error as MeshReelError);
    }
    this.#isStalled = false;
    const { nFrames, fps } = playback.clock;
    const position = frameAtTime(shownS - offset, fps);
    if (position < nFrames) {
      this.picture = "captured";
      return this.#follow(position);
    }
    picture.discard();
    this.picture = "over";
    this.#finish();
  }

  /** Make the mesh follow to a position in frames, whose picture is pending or captured. */
  #follow(position: number): void {
    const { playback } = this.#options;
    playback.clock.seek(position);
    playback.show();
  }

  /** Repeat or stop at the end of the last frame. */
  #finish(): void {
    const { playback, send } = this.#options;
    const { clock } = playback;
    if (!playback.isPlaying) {
      clock.seek(clock.nFrames - 1);
      this.seek(clock.position);
    } else if (!clock.loop) {
      playback.pause();
      clock.goToEnd();
      send({ type: "ended" });
    } else {
      clock.seek(0);
      this.seek(0);
      this.play();
      send({ type: "loop" });
    }
    playback.show();
  }

  #expectPicture(): void {
    this.picture = "pending";
    this.#isStalled = false;
    this.#announcedTime = null;
    this.#options.picture.discard();
    clearTimeout(this.#timeout);
  }

  #seekVideo(position: number): void {
    const { video, playback, offset } = this.#options;
    const last = Number.isFinite(video.duration) ? video.duration - TIME_TOLERANCE_S : Infinity;
    const wanted = offset + seekTime(position, playback.clock.fps);
    this.#targetTime = Math.max(Math.min(wanted, last), 0);
    video.currentTime = this.#targetTime;
  }

  /** Handle a seek that this class did not start. */
  #onExternalSeek(): void {
    const { video, playback, offset } = this.#options;
    this.#targetTime = this.#queuedPosition = null;
    this.#expectPicture();
    this.#follow(frameAtTime(video.currentTime - offset, playback.clock.fps));
  }

  #onSeeked(): void {
    const { video } = this.#options;
    if (video.seeking) return; // another seek has started
    this.#targetTime = null;
    const next = this.#queuedPosition;
    this.#queuedPosition = null;
    if (next !== null) return this.#seekVideo(next);
    this.#settledMs = performance.now() + (announcesFrames(video) ? GECKO_SETTLING_MS : 0);
    clearTimeout(this.#timeout);
    this.#timeout = setTimeout(() => {
      if (this.picture === "pending" && !this.#isSeeking()) this.#capture(video.currentTime);
    }, FRAME_CALLBACK_TIMEOUT_MS);
  }

  #setStalled(isStalled: boolean): void {
    this.#isStalled = isStalled;
    this.picture = isStalled ? "pending" : "captured";
    this.#options.playback.show();
  }

  #reportError(error: Error): void {
    this.#options.playback.pause();
    this.#options.send({ type: "error", error, block: null });
  }
}

/**
 * Whether the browser calls back before it displays an image, as Gecko does (Firefox 153): until
 * then, drawing the video yields the previous image. Chromium calls back when drawing the video
 * already yields the new one, although `expectedDisplayTime` is later.
 */
function announcesFrames(video: HTMLVideoElement): boolean {
  return "mozHasAudio" in video;
}
