// Attributes of a player as properties.

import { type AttributeName, ATTRIBUTES } from "./settings.js";

const BOOLEANS: readonly AttributeName[] = ["autoplay", "camera-controls", "controls", "muted"];
const NUMBERS: readonly AttributeName[] = ["speed", "start-time", "start-frame", "texture-offset"];

/** Servers that render pages have no elements; there the script may be imported, and does nothing. */
const Element = typeof HTMLElement === "undefined" ? (class {} as typeof HTMLElement) : HTMLElement;

/** An element with the attributes of a player, each of which is a property of its name. */
export abstract class PlayerAttributes extends Element {
  /** Address of the file. */
  declare src: string | null;
  /** What the picture shows, in words. */
  declare alt: string | null;
  /** Plays as soon as it can, unless people have asked their system for less motion. */
  declare autoplay: boolean;
  /** Plays again and again: true or "repeat", or there and back: "pingpong". */
  declare loop: boolean | string;
  /** Seconds of the animation in a second; 1 by default, backwards if negative. */
  declare speed: number | null;
  /** Where it begins, in seconds. */
  declare startTime: number | null;
  /** Where it begins, as a frame from 0 on. */
  declare startFrame: number | null;
  /** Whether pictures between frames are shown; true by default. */
  declare interpolate: boolean;
  /** Lets people turn, move and zoom the picture. */
  declare cameraControls: boolean;
  /** Shows a bar with play, time, sound and full screen. */
  declare controls: boolean;
  /** The axis of the file that is upwards: "y", the default, or "z". */
  declare up: string | null;
  /** A color of CSS behind the model; without it that of the style sheet of the page or the system. */
  declare background: string | null;
  /** Address of an image that is shown before the first picture is there. */
  declare poster: string | null;
  /** Address of an image or a video that is shown on the model. */
  declare texture: string | null;
  /** "image" or "video", where the address of the texture does not say so. */
  declare textureKind: string | null;
  /** Time of the video at the first frame of the model, in seconds. */
  declare textureOffset: number | null;
  /** Where pictures of the video hold the number of their frame: x, y, cell and bits. */
  declare frameNumber: string | null;
  /** Plays the video without its sound. */
  declare muted: boolean;
  /** Name of a track that the model has the colours of. */
  declare track: string | null;
  /** Of its values: "x", "y", "z", a number from 0 on, or "magnitude". */
  declare trackComponent: string | null;
  /** Where its colours end, such as "0:500" or "2%:98%". */
  declare trackRange: string | null;
  /** "sequential" or "diverging". */
  declare trackColormap: string | null;

  /** Takes properties that were set before the element was defined. */
  protected upgrade(): void {
    for (const name of ATTRIBUTES) {
      const property = propertyOf(name);
      if (!Object.hasOwn(this, property)) continue;
      const value: unknown = Reflect.get(this, property);
      Reflect.deleteProperty(this, property);
      Reflect.set(this, property, value);
    }
  }
}

for (const name of ATTRIBUTES) {
  Object.defineProperty(PlayerAttributes.prototype, propertyOf(name), {
    configurable: true,
    enumerable: true,
    get(this: HTMLElement) {
      return valueOf(name, this.getAttribute(name));
    },
    set(this: HTMLElement, value: unknown) {
      const isOff = value === null || value === undefined || value === false;
      if (isOff && name !== "interpolate") this.removeAttribute(name);
      else this.setAttribute(name, value === true ? "" : String(value));
    },
  });
}

function valueOf(name: AttributeName, value: string | null): unknown {
  if (BOOLEANS.includes(name)) return value !== null;
  if (NUMBERS.includes(name)) return value === null ? null : Number(value);
  if (name === "interpolate") return value !== "false";
  if (name === "loop") return value === null ? false : value || true;
  return value;
}

function propertyOf(name: AttributeName): string {
  return name.replace(/-(.)/g, (_, letter: string) => letter.toUpperCase());
}
