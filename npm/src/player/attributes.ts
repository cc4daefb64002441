// Reflects the attributes of a player as properties.

import { ATTRIBUTE_NAMES, type AttributeName, ATTRIBUTES } from "./settings.js";

/** Without a DOM, as in server-side rendering, importing the script must not fail. */
const Element = typeof HTMLElement === "undefined" ? (class {} as typeof HTMLElement) : HTMLElement;

/** Base class of the player: each attribute is also a property. */
export abstract class PlayerAttributes extends Element {
  /** Address of the file. */
  declare src: string | null;
  /** Text alternative: describes the animation. */
  declare alt: string | null;
  /** "eager", the default, or "lazy": opens the file when the player is near the viewport. */
  declare loading: string | null;
  /** Plays once the file is open, unless the user prefers reduced motion. */
  declare autoplay: boolean;
  /** Repeats: true or "repeat" from the start, "pingpong" forwards and backwards. */
  declare loop: boolean | string;
  /** Playback rate; 1 by default, negative values play backwards. */
  declare speed: number | null;
  /** Initial time, in seconds. */
  declare startTime: number | null;
  /** Initial frame, counted from 0. */
  declare startFrame: number | null;
  /** Whether to interpolate between frames; true by default. */
  declare interpolate: boolean;
  /** Enables rotating, panning and zooming. */
  declare cameraControls: boolean;
  /** Initial view: azimuth, angle from the vertical and distance, such as "30deg 75deg 105%". */
  declare cameraOrbit: string | null;
  /** Point that the camera looks at, in coordinates of the file, such as "0 1.5 0". */
  declare cameraTarget: string | null;
  /** Vertical field of view, such as "30deg", the default. */
  declare fieldOfView: string | null;
  /** Rotates the camera around the model, unless the user prefers reduced motion. */
  declare autoRotate: boolean;
  /** Shows a control bar: play, steps of a frame, timeline, speed, sound, full screen. */
  declare controls: boolean;
  /** The up axis of the file: "y", the default, or "z". */
  declare up: string | null;
  /** Background, a CSS color; by default the color of the style sheet or of the color scheme. */
  declare background: string | null;
  /** Address of an image that is shown until the first frame is drawn. */
  declare poster: string | null;
  /** Address of an image or video to use as texture. */
  declare texture: string | null;
  /** "image" or "video", if the file extension of the texture does not tell. */
  declare textureKind: string | null;
  /** Time of the texture video at the first frame of the mesh, in seconds. */
  declare textureOffset: number | null;
  /** Where images of the video encode their frame number: x, y, cell and bits. */
  declare frameNumber: string | null;
  /** Mutes the video. */
  declare muted: boolean;
  /** Name of the track that colors the mesh. */
  declare track: string | null;
  /** Component of its values: "x", "y", "z", a column index, or "magnitude". */
  declare trackComponent: string | null;
  /** Range of its color map, such as "0:500" or "2%:98%". */
  declare trackRange: string | null;
  /** Color map: "sequential" or "diverging". */
  declare trackColormap: string | null;

  /** Apply properties that were set before the element was defined. */
  protected upgradeProperties(): void {
    for (const name of ATTRIBUTE_NAMES) {
      const property = propertyName(name);
      if (!Object.hasOwn(this, property)) continue;
      const value: unknown = Reflect.get(this, property);
      Reflect.deleteProperty(this, property);
      Reflect.set(this, property, value);
    }
  }
}

for (const name of ATTRIBUTE_NAMES) {
  Object.defineProperty(PlayerAttributes.prototype, propertyName(name), {
    configurable: true,
    enumerable: true,
    get(this: HTMLElement) {
      return parseValue(name, this.getAttribute(name));
    },
    set(this: HTMLElement, value: unknown) {
      const isOff = value === null || value === undefined || value === false;
      if (isOff && name !== "interpolate") this.removeAttribute(name);
      else this.setAttribute(name, value === true ? "" : String(value));
    },
  });
}

function parseValue(name: AttributeName, value: string | null): unknown {
  switch (ATTRIBUTES[name]) {
    case "flag":
      return value !== null;
    case "number":
      return value === null ? null : Number(value);
    case "switch":
      return value !== "false";
    case "loop":
      return value === null ? false : value || true;
    default:
      return value;
  }
}

function propertyName(name: AttributeName): string {
  return name.replace(/-(.)/g, (_, letter: string) => letter.toUpperCase());
}
