// A video that leads a mesh: the mesh shows the frame of the picture that the video shows.

import { InvalidInputError, MeshReelError } from "../../errors.js";
import type { Leader, Playback, PlaybackEvent } from "../playback.js";
import { commonOf, placeOf, timeOf } from "./frame_times.js";
import { videoError } from "./texture_source.js";
import type { VideoPicture } from "./video_picture.js";

/** Off by less than this, a time is the one that was asked for. */
const SAME_S = 1e-3;

/** The same for times of the page, in milliseconds. */
const SAME_MS = 1;

/** For so long after it was sought, Gecko may still show another picture than it tells of. */
const SETTLING_MS = 100;

/**
 * Browsers tell of the picture that a video shows after it was sought, but for some of those that
 * were shown before. If nothing is told for this long, the time of the video says which one it is.
 */
const TOLD_MS = 250;

/** What leads, and what is led. */
export interface VideoSetting {
  readonly video: HTMLVideoElement;
  readonly picture: VideoPicture;
  readonly playback: Playback;
  /** Time of the video at the first frame of the mesh, in seconds. */
  readonly offset: number;
  readonly send: (event: PlaybackEvent) => void;
  /** Is told that a picture is shown. */
  readonly onShown: () => void;
}

/**
 * Keeps a mesh in step with a video, and the other way round: what is asked of the mesh is done to
 * the video, and what is done to the video, such as by its own controls, is done to the mesh.
 */
export class VideoLeader implements Leader {
  readonly #setting: VideoSetting;
  picture: Leader["picture"] = "awaited";
  readonly #listening = new AbortController();
  /** Where it was sent; null once it is there, or was sent elsewhere by others. */
  #target: number | null = null;
  /** The place to send it to when it is where it was sent before. */
  #next: number | null = null;
  #isHeld = false;
  #isStalled = false;
  #hasWarned = false;
  readonly #wasLooping: boolean;
  #asked: number | null = null;
  #late: ReturnType<typeof setTimeout> | undefined;
  #lastTime: number | null = null;
  /** Time of a picture that was told of, and is about to be shown. */
  #announced: number | null = null;
  /** When its pictures are what is told of them, after it was sought. */
  #settledMs = 0;

  /**
   * The length of the video must be known.
   *
   * @throws InvalidInputError where the mesh plays backwards, or at a speed that videos do not have.
   */
  constructor(setting: VideoSetting) {
    this.#setting = setting;
    const { video, playback } = setting;
    this.#lead();
    try {
      this.setSpeed(playback.clock.speed);
    } catch (error) {
      playback.setLeader(null);
      throw error;
    }
    this.#wasLooping = video.loop;
    if (video.loop) playback.clock.loop = "repeat";
    video.loop = false; // loops are those of the mesh
    this.#listen();
    this.#ask();
    if (video.paused) this.seek(playback.clock.place);
    if (!video.paused && !playback.isPlaying) playback.play();
    else if (video.paused && playback.isPlaying) this.play();
  }

  show(): boolean {
    const isOther = this.#setting.picture.show();
    if (isOther) this.#setting.onShown();
    return isOther;
  }

  play(): void {
    if (this.#isHeld) return;
    const { video, playback, send } = this.#setting;
    video.play().catch((error: DOMException) => {
      if (error.name !== "NotAllowedError") return; // a pause, or what "error" tells
      playback.pause();
      const message =
        "the browser does not play videos with sound before someone clicks or presses a key:" +
        " call play() then, or mute the video";
      send({ type: "warning", message });
    });
  }

  pause(): void {
    this.#setting.video.pause();
  }

  seek(place: number): void {
    this.#await();
    if (this.#target !== null && this.#setting.video.seeking) this.#next = place;
    else this.#go(place);
  }

  setSpeed(speed: number): void {
    try {
      this.#setting.video.playbackRate = speed;
    } catch {
      throw new InvalidInputError(
        `this browser does not play videos at the speed ${speed}; most do from 0.0625 to 16`,
      );
    }
  }

  hold(isHeld: boolean): void {
    if (this.#isHeld === isHeld) return;
    this.#isHeld = isHeld;
    const { video, playback } = this.#setting;
    if (isHeld) video.pause();
    else if (playback.isPlaying && !video.ended) this.play();
  }

  /** Where the browser does not tell of pictures, its time has to do. */
  update(): void {
    const { video } = this.#setting;
    if (this.#asked !== null || video.readyState < video.HAVE_CURRENT_DATA) return;
    if (!this.#isSought() && video.currentTime !== this.#lastTime) this.#take(video.currentTime);
  }

  /** Leaves the mesh and the video alone; they stay as they are. */
  dispose(): void {
    const { video, playback } = this.#setting;
    this.#listening.abort();
    this.#announced = null;
    clearTimeout(this.#late);
    if (this.#asked !== null) video.cancelVideoFrameCallback(this.#asked);
    video.loop = this.#wasLooping;
    playback.setLeader(null);
    if (playback.isWaiting) playback.show();
  }

  /** Leads over the frames that mesh and video have in common. */
  #lead(): void {
    const { video, playback, offset, send } = this.#setting;
    const common = commonOf(playback.nFrames, playback.clock.fps, video.duration - offset);
    playback.setLeader(this, common.nFrames);
    if (!common.warning || this.#hasWarned) return;
    this.#hasWarned = true;
    send({ type: "warning", message: common.warning });
  }

  #listen(): void {
    const { video, playback } = this.#setting;
    const on = (types: string, told: () => void) => {
      for (const type of types.split(" ")) {
        video.addEventListener(type, told, { signal: this.#listening.signal });
      }
    };
    // Events come late: what they tell counts if it still holds, and is not of our own doing.
    on("play", () => {
      if (video.paused) return;
      if (this.#isHeld) video.pause();
      else if (!playback.isPlaying) playback.play();
    });
    on("pause", () => {
      if (video.paused && !video.ended && !this.#isHeld && playback.isPlaying) playback.pause();
    });
    on("ended", () => {
      if (video.ended && playback.isPlaying) playback.finish();
    });
    on("seeking", () => {
      const isOwn = this.#target !== null && Math.abs(video.currentTime - this.#target) < SAME_S;
      if (!isOwn) this.#wasSought();
    });
    on("seeked", () => this.#arrive());
    on("ratechange", () => {
      playback.clock.speed = video.playbackRate;
    });
    on("durationchange", () => this.#lead());
    on("waiting", () => {
      if (!video.paused && !this.#isSought() && this.picture === "taken") this.#stall(true);
    });
    on("canplay playing", () => {
      if (this.#isStalled) this.#stall(false);
    });
    on("error", () => this.#fail(videoError(video)));
  }

  #ask(): void {
    const { video } = this.#setting;
    if (!("requestVideoFrameCallback" in video)) return;
    this.#asked = video.requestVideoFrameCallback((now, { mediaTime, expectedDisplayTime }) => {
      this.#ask();
      if (this.#isSought()) return;
      if (!announces(video)) return this.#take(mediaTime);
      if (this.#announced !== null && now >= this.#settledMs) this.#take(this.#announced);
      const dueMs = Math.max(expectedDisplayTime, this.#settledMs);
      if (dueMs - now < SAME_MS) return this.#take(mediaTime);
      this.#announced = mediaTime;
      const look = (refresh: number) => {
        if (this.#announced !== mediaTime || this.#isSought()) return;
        if (dueMs - refresh < SAME_MS) this.#take(mediaTime);
        else requestAnimationFrame(look);
      };
      requestAnimationFrame(look);
    });
  }

  /** Whether it is on its way, so that its picture is not the one that was asked for. */
  #isSought(): boolean {
    return this.#setting.video.seeking || this.#next !== null;
  }

  /** Takes the picture that is shown, which is said to be of a time, and has the mesh follow. */
  #take(timeS: number): void {
    const { video, picture, playback, offset, send } = this.#setting;
    clearTimeout(this.#late);
    this.#announced = null;
    this.#lastTime = timeS;
    let shownS: number;
    try {
      shownS = picture.take(video, timeS);
    } catch (error) {
      return this.#fail(error as MeshReelError);
    }
    this.#isStalled = false;
    const { nFrames, fps } = playback.clock;
    const seen = picture.isNumbered ? picture.readNumber() : placeOf(shownS - offset, fps);
    const isOver = seen !== null && seen >= nFrames;
    if (seen !== null && !isOver) {
      this.picture = "taken";
      return playback.follow(seen);
    }
    picture.drop();
    this.picture = "unknown";
    if (isOver && !picture.isNumbered) return playback.finish();
    send({ type: "unreadable", time: shownS });
    playback.show();
  }

  #await(): void {
    this.picture = "awaited";
    this.#isStalled = false;
    this.#announced = null;
    this.#setting.picture.drop();
    clearTimeout(this.#late);
  }

  #go(place: number): void {
    const { video, playback, offset } = this.#setting;
    const last = Number.isFinite(video.duration) ? video.duration - SAME_S : Infinity;
    const wanted = offset + timeOf(place, playback.clock.fps);
    this.#target = Math.max(Math.min(wanted, last), 0);
    video.currentTime = this.#target;
  }

  /** Others have sent it elsewhere. */
  #wasSought(): void {
    const { video, playback, offset } = this.#setting;
    this.#target = this.#next = null;
    this.#await();
    playback.follow(placeOf(video.currentTime - offset, playback.clock.fps));
  }

  #arrive(): void {
    const { video } = this.#setting;
    if (video.seeking) return; // elsewhere again
    this.#target = null;
    const next = this.#next;
    this.#next = null;
    if (next !== null) return this.#go(next);
    this.#settledMs = performance.now() + (announces(video) ? SETTLING_MS : 0);
    clearTimeout(this.#late);
    this.#late = setTimeout(() => {
      if (this.picture === "awaited" && !this.#isSought()) this.#take(video.currentTime);
    }, TOLD_MS);
  }

  #stall(isStalled: boolean): void {
    this.#isStalled = isStalled;
    this.picture = isStalled ? "awaited" : "taken";
    this.#setting.playback.show();
  }

  #fail(error: Error): void {
    this.#setting.playback.pause();
    this.#setting.send({ type: "error", error, block: null });
  }
}

/**
 * Whether a browser tells of pictures before it shows them, as Gecko does (Firefox 153): what is
 * drawn of the video is the one before until then. Chromium tells when it is drawn already, and
 * names a later time as well.
 */
function announces(video: HTMLVideoElement): boolean {
  return "mozHasAudio" in video;
}
