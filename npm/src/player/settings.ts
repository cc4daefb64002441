// What the attributes of a player say.

import { InvalidInputError } from "../errors.js";
import type { Loop } from "../three/clock.js";
import type { Component } from "../three/color/color_range.js";
import type { FrameNumber } from "../three/texture/frame_number.js";
import type { Kind } from "../three/texture/texture_source.js";

/** What the attributes of a player say, with defaults for those that are not there. */
export interface PlayerSettings {
  readonly src: string | null;
  readonly alt: string | null;
  readonly autoplay: boolean;
  readonly loop: Loop;
  readonly speed: number;
  /** Where it begins: seconds, or a frame. */
  readonly start: number | { readonly frame: number };
  readonly interpolate: boolean;
  readonly cameraControls: boolean;
  readonly controls: boolean;
  /** The axis of the file that is upwards. */
  readonly up: "y" | "z";
  /** A colour of CSS. */
  readonly background: string | null;
  readonly poster: string | null;
  readonly texture: string | null;
  readonly kind: Kind | undefined;
  /** Seconds. */
  readonly offset: number | undefined;
  readonly frameNumber: FrameNumber | undefined;
  readonly muted: boolean;
  /** The track that the model has the colours of. */
  readonly track: string | null;
  readonly component: Component | undefined;
  readonly range: string | undefined;
  readonly map: "sequential" | "diverging" | undefined;
}

/** Names of the attributes. */
export const ATTRIBUTES = [
  "src",
  "alt",
  "autoplay",
  "loop",
  "speed",
  "start-time",
  "start-frame",
  "interpolate",
  "camera-controls",
  "controls",
  "up",
  "background",
  "poster",
  "texture",
  "texture-kind",
  "texture-offset",
  "frame-number",
  "muted",
  "track",
  "track-component",
  "track-range",
  "track-colormap",
] as const;

/** One of the attributes. */
export type AttributeName = (typeof ATTRIBUTES)[number];

/** The value of an attribute; null where it is not there. */
type Given = (name: AttributeName) => string | null;

/** Those that say something of the texture, or of the track. */
const OF_TEXTURE = ["texture-kind", "texture-offset", "frame-number", "muted"] as const;
const OF_TRACK = ["track-component", "track-range", "track-colormap"] as const;

/**
 * What attributes say.
 *
 * @throws InvalidInputError where a value is none of those that are allowed, or has no effect.
 */
export function settingsOf(given: Given): PlayerSettings {
  const [texture, track] = [addressOf(given, "texture"), given("track")];
  if (texture === null) refuse(given, OF_TEXTURE, "texture");
  if (track === null) refuse(given, OF_TRACK, "track");
  if (texture !== null && track !== null) {
    throw new InvalidInputError(
      "texture and track both say what is on the model; leave one of them away",
    );
  }
  return {
    src: addressOf(given, "src"),
    alt: given("alt"),
    autoplay: isThere(given, "autoplay"),
    loop: loopOf(given("loop")),
    speed: numberOf(given, "speed") ?? 1,
    start: startOf(given),
    interpolate: choiceOf(given, "interpolate", ["", "true", "false"]) !== "false",
    cameraControls: isThere(given, "camera-controls"),
    controls: isThere(given, "controls"),
    up: choiceOf(given, "up", ["y", "z"]) ?? "y",
    background: given("background"),
    poster: addressOf(given, "poster"),
    texture,
    kind: choiceOf(given, "texture-kind", ["image", "video"]),
    offset: numberOf(given, "texture-offset"),
    frameNumber: frameNumberOf(given("frame-number")),
    muted: isThere(given, "muted"),
    track,
    component: componentOf(given("track-component")),
    range: given("track-range") ?? undefined,
    map: choiceOf(given, "track-colormap", ["sequential", "diverging"]),
  };
}

/** @throws InvalidInputError where one of these is there, which has no effect. */
function refuse(given: Given, names: readonly AttributeName[], without: string): void {
  const useless = names.find((name) => given(name) !== null);
  if (!useless) return;
  throw new InvalidInputError(
    `${useless} is for a ${without} only; add ${without}, or leave it away`,
  );
}

/** An address; null where it is empty, which would be that of the page itself. */
function addressOf(given: Given, name: AttributeName): string | null {
  return given(name)?.trim() || null;
}

/** A component, which whoever shows the track checks. */
function componentOf(value: string | null): Component | undefined {
  if (value === null) return undefined;
  return /^\d+$/.test(value) ? Number(value) : (value as Component);
}

/** HTML takes `loop="false"` for `loop`; who writes that means something else. */
function isThere(given: Given, name: AttributeName): boolean {
  const value = given(name);
  if (value === null || value === "" || value.toLowerCase() === name) return value !== null;
  throw new InvalidInputError(`${name} is there or not, and has no value; got ${name}="${value}"`);
}

function loopOf(value: string | null): Loop {
  if (value === null) return "once";
  if (value === "" || value === "loop" || value === "repeat") return "repeat";
  if (value === "pingpong") return value;
  throw new InvalidInputError(
    `loop has no value, or is "repeat" or "pingpong"; got loop="${value}"`,
  );
}

function numberOf(given: Given, name: AttributeName): number | undefined {
  const value = given(name);
  if (value === null) return undefined;
  const number = Number(value);
  if (value.trim() && Number.isFinite(number)) return number;
  throw new InvalidInputError(`${name} must be a number; got ${name}="${value}"`);
}

function choiceOf<Choice extends string>(
  given: Given,
  name: AttributeName,
  choices: readonly Choice[],
): Choice | undefined {
  const value = given(name);
  const choice = choices.find((one) => one === value);
  if (choice !== undefined || value === null) return choice;
  const allowed = choices.filter(Boolean).map((one) => `"${one}"`).join(" or ");
  throw new InvalidInputError(`${name} is ${allowed}; got ${name}="${value}"`);
}

function startOf(given: Given): PlayerSettings["start"] {
  const [time, frame] = [numberOf(given, "start-time"), numberOf(given, "start-frame")];
  if (time === undefined) return frame === undefined ? 0 : { frame };
  if (frame === undefined) return time;
  throw new InvalidInputError("start-time and start-frame say the same; leave one of them away");
}

function frameNumberOf(value: string | null): FrameNumber | undefined {
  if (value === null) return undefined;
  const numbers = value.trim().split(/\s+/).map(Number);
  if (numbers.length === 4 && numbers.every(Number.isFinite)) {
    const [x, y, cell, bits] = numbers;
    return { x, y, cell, bits };
  }
  throw new InvalidInputError(
    `frame-number is four numbers, such as "0 0 16 12": left and upper edge of the first cell, side` +
      ` of a cell, bits; got frame-number="${value}"`,
  );
}
