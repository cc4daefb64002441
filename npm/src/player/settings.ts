// Parses the attributes of a player.

import { InvalidInputError } from "../errors.js";
import type { Loop } from "../three/clock.js";
import type { Component } from "../three/color/color_range.js";

/** The initial view, as `camera-orbit`, `camera-target` and `field-of-view` describe it. */
export interface CameraSettings {
  /** Azimuth, and angle from the vertical, in radians. */
  readonly theta: number;
  readonly phi: number;
  /** Distance in model units; null: as close as all points are in view. */
  readonly distance: number | null;
  /** Factor of that closest distance. */
  readonly zoom: number;
  /** In the coordinates of the file; null: the center of the model. */
  readonly target: readonly (number | null)[];
  /** Vertical field of view, in degrees. */
  readonly fieldOfView: number;
}

/** The attributes, and the types of their values. */
export const ATTRIBUTES = {
  /** Address of the file. */
  src: "text",
  /** Text alternative: describes the animation. */
  alt: "text",
  /** "eager", the default, or "lazy": opens the file when the player is near the viewport. */
  loading: "text",
  /** Plays once the file is open, unless the user prefers reduced motion. */
  autoplay: "flag",
  /** Repeats: true or "repeat" from the start, "pingpong" forwards and backwards. */
  loop: "loop",
  /** Playback rate; 1 by default, negative values play backwards. */
  speed: "number",
  /** Initial time, in seconds. */
  "start-time": "number",
  /** Initial frame, counted from 0. */
  "start-frame": "number",
  /** Whether to interpolate between frames; true by default. */
  interpolate: "switch",
  /** Enables rotating, panning and zooming. */
  "camera-controls": "flag",
  /** Initial view: azimuth, angle from the vertical and distance, such as "30deg 75deg 105%". */
  "camera-orbit": "text",
  /** Point that the camera looks at, in coordinates of the file, such as "0 1.5 0". */
  "camera-target": "text",
  /** Vertical field of view, such as "30deg", the default. */
  "field-of-view": "text",
  /** Rotates the camera around the model, unless the user prefers reduced motion. */
  "auto-rotate": "flag",
  /** Shows a control bar: play, steps of a frame, timeline, speed, sound, full screen. */
  controls: "flag",
  /** The up axis of the file: "y", the default, or "z". */
  up: "text",
  /** Background, a CSS color; by default the color of the style sheet or of the color scheme. */
  background: "text",
  /** Address of an image that is shown until the first frame is drawn. */
  poster: "text",
  /** Address of an image or video to use as texture. */
  texture: "text",
  /** "image" or "video", if the file extension of the texture does not tell. */
  "texture-kind": "text",
  /** Time of the texture video at the first frame of the mesh, in seconds. */
  "texture-offset": "number",
  /** Mutes the video. */
  muted: "flag",
  /** Name of the track that colors the mesh. */
  track: "text",
  /** Component of its values: "x", "y", "z", a column index, or "magnitude". */
  "track-component": "text",
  /** Range of its color map, such as "0:500" or "2%:98%". */
  "track-range": "text",
  /** Color map: "sequential" or "diverging". */
  "track-colormap": "text",
} as const;

/** One of the attributes. */
export type AttributeName = keyof typeof ATTRIBUTES;

export const ATTRIBUTE_NAMES = Object.keys(ATTRIBUTES) as AttributeName[];

/** The view without the attributes of the camera: slightly from above. Angles in degrees. */
const DEFAULT_ORBIT = { theta: 0, phi: 78 };
const DEFAULT_FIELD_OF_VIEW = 30;

/** Returns the value of an attribute; null if it is missing. */
type ReadAttribute = (name: AttributeName) => string | null;

/** Attributes that need a texture or a track. */
const TEXTURE_ATTRIBUTES = ["texture-kind", "texture-offset"] as const;
const TRACK_ATTRIBUTES = ["track-component", "track-range", "track-colormap"] as const;

/** Parsed attributes of a player, with defaults; `start` is seconds, or a frame. */
export type PlayerSettings = Readonly<ReturnType<typeof parseSettings>>;

/**
 * Parse the attributes of a player.
 *
 * @throws InvalidInputError if a value is invalid or has no effect.
 */
export function parseSettings(read: ReadAttribute) {
  const [texture, track] = [parseAddress(read, "texture"), read("track")];
  if (texture === null) rejectUnused(read, TEXTURE_ATTRIBUTES, "texture");
  if (track === null) rejectUnused(read, TRACK_ATTRIBUTES, "track");
  if (texture !== null && track !== null) {
    throw new InvalidInputError(
      "texture and track cannot be combined; remove one of them",
    );
  }
  return {
    src: parseAddress(read, "src"),
    alt: read("alt"),
    loading: parseChoice(read, "loading", ["eager", "lazy"]) ?? "eager",
    autoplay: parseFlag(read, "autoplay"),
    loop: parseLoop(read),
    speed: parseNumber(read, "speed") ?? 1,
    start: parseStart(read),
    interpolate: parseChoice(read, "interpolate", ["", "true", "false"]) !== "false",
    cameraControls: parseFlag(read, "camera-controls"),
    camera: parseCamera(read),
    autoRotate: parseFlag(read, "auto-rotate"),
    controls: parseFlag(read, "controls"),
    up: parseChoice(read, "up", ["y", "z"]) ?? "y",
    background: read("background"),
    poster: parseAddress(read, "poster"),
    texture,
    kind: parseChoice(read, "texture-kind", ["image", "video"]),
    offset: parseNumber(read, "texture-offset"),
    muted: parseFlag(read, "muted"),
    track,
    component: parseComponent(read("track-component")),
    range: read("track-range") ?? undefined,
    map: parseChoice(read, "track-colormap", ["sequential", "diverging"]),
  };
}

/** @throws InvalidInputError if one of these attributes is present, which would have no effect. */
function rejectUnused(read: ReadAttribute, names: readonly AttributeName[], without: string): void {
  const unused = names.find((name) => read(name) !== null);
  if (!unused) return;
  throw new InvalidInputError(
    `${unused} has no effect without ${without}; add ${without}, or remove it`,
  );
}

/** Parse an address; null if it is empty, which would mean the page itself. */
function parseAddress(read: ReadAttribute, name: AttributeName): string | null {
  return read(name)?.trim() || null;
}

/** Parse a component; `ReelMesh.colorBy` validates it. */
export function parseComponent(value: string | null): Component | undefined {
  if (value === null) return undefined;
  return /^\d+$/.test(value) ? Number(value) : (value as Component);
}

/** HTML treats `autoplay="false"` as `autoplay`, which is hardly intended: refuse it. */
function parseFlag(read: ReadAttribute, name: AttributeName): boolean {
  const value = read(name);
  if (value === null || value === "" || value.toLowerCase() === name) return value !== null;
  throw new InvalidInputError(`${name} is a boolean attribute without a value; got ${name}="${value}"`);
}

function parseLoop(read: ReadAttribute): Loop {
  const loop = parseChoice(read, "loop", ["", "loop", "repeat", "pingpong"]);
  return loop === "pingpong" ? loop : loop !== undefined;
}

function parseNumber(read: ReadAttribute, name: AttributeName): number | undefined {
  const value = read(name);
  if (value === null) return undefined;
  const number = Number(value);
  if (value.trim() && Number.isFinite(number)) return number;
  throw new InvalidInputError(`${name} must be a number; got ${name}="${value}"`);
}

/** Parse the attributes of the camera, in the syntax of <model-viewer>. */
function parseCamera(read: ReadAttribute): CameraSettings {
  const [theta, phi, radius] = parseTriple(read, "camera-orbit", "30deg 75deg 105%");
  const [thetaRad, phiRad] = [
    parseAngle(theta, DEFAULT_ORBIT.theta, "camera-orbit").radians,
    parseAngle(phi, DEFAULT_ORBIT.phi, "camera-orbit").radians,
  ];
  const isRelative = radius.endsWith("%") || radius === "auto";
  const zoom = radius.endsWith("%") ? parseLength(radius.slice(0, -1), "camera-orbit") / 100 : 1;
  const distance = isRelative ? null : parseLength(radius, "camera-orbit");
  if (!(zoom > 0) || (distance !== null && !(distance > 0))) {
    throw new InvalidInputError(`the radius of camera-orbit must be above 0; got "${radius}"`);
  }
  const target = parseTriple(read, "camera-target", "0 1.5 0").map((word) =>
    word === "auto" ? null : parseLength(word, "camera-target"),
  );
  const fov = read("field-of-view") ?? "auto";
  const fieldOfView = parseAngle(fov, DEFAULT_FIELD_OF_VIEW, "field-of-view").degrees;
  if (!(fieldOfView > 0 && fieldOfView < 180)) {
    throw new InvalidInputError(`field-of-view must be above 0deg and below 180deg; got "${fov}"`);
  }
  return { theta: thetaRad, phi: phiRad, distance, zoom, target, fieldOfView };
}

/** Split a value into three words; a missing attribute, and a single "auto", mean three times "auto". */
function parseTriple(read: ReadAttribute, name: AttributeName, example: string): string[] {
  const words = (read(name) ?? "auto").trim().split(/\s+/);
  if (words.length === 1 && words[0] === "auto") return ["auto", "auto", "auto"];
  if (words.length === 3) return words;
  throw new InvalidInputError(`${name} must be "auto", or three values such as "${example}"; got "${read(name)}"`);
}

/** Parse an angle with its unit; "auto" means a default in degrees. */
function parseAngle(
  word: string,
  defaultDeg: number,
  name: AttributeName,
): { radians: number; degrees: number } {
  const [, text, unit] = /^([-+.\de]+)(deg|rad)$/.exec(word === "auto" ? `${defaultDeg}deg` : word) ?? [];
  const number = Number(text);
  if (!unit || !Number.isFinite(number)) {
    throw new InvalidInputError(`${name} needs angles such as "30deg" or "0.5rad"; got "${word}"`);
  }
  if (unit === "deg") return { degrees: number, radians: (number * Math.PI) / 180 };
  return { degrees: (number * 180) / Math.PI, radians: number };
}

/** Parse a length in model units, which <model-viewer> writes in meters. */
function parseLength(word: string, name: AttributeName): number {
  const number = Number(word.replace(/m$/, "") || NaN);
  if (Number.isFinite(number)) return number;
  throw new InvalidInputError(`${name} needs numbers in model units, such as "1.5"; got "${word}"`);
}

function parseChoice<Choice extends string>(
  read: ReadAttribute,
  name: AttributeName,
  choices: readonly Choice[],
): Choice | undefined {
  const value = read(name);
  const choice = choices.find((allowed) => allowed === value);
  if (choice !== undefined || value === null) return choice;
  const allowed = choices.filter(Boolean).map((name) => `"${name}"`).join(" or ");
  throw new InvalidInputError(`${name} must be ${allowed}; got ${name}="${value}"`);
}

function parseStart(read: ReadAttribute): number | { readonly frame: number } {
  const [time, frame] = [parseNumber(read, "start-time"), parseNumber(read, "start-frame")];
  if (time === undefined) return frame === undefined ? 0 : { frame };
  if (frame === undefined) return time;
  throw new InvalidInputError("start-time and start-frame cannot be combined; remove one of them");
}
