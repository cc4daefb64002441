// Types of the attributes of a player in JSX.

import type { AttributeName } from "./settings.js";

/** A boolean attribute. React 18 renders `true` as the text "true": pass "" instead. */
type Flag = boolean | "";

interface Values {
  src: string;
  alt: string;
  loading: "eager" | "lazy";
  autoplay: Flag;
  loop: Flag | "repeat" | "pingpong";
  speed: number | string;
  "start-time": number | string;
  "start-frame": number | string;
  interpolate: boolean | "true" | "false";
  "camera-controls": Flag;
  "camera-orbit": string;
  "camera-target": string;
  "field-of-view": string;
  "auto-rotate": Flag;
  controls: Flag;
  up: "y" | "z";
  background: string;
  poster: string;
  texture: string;
  "texture-kind": "image" | "video";
  "texture-offset": number | string;
  "frame-number": string;
  muted: Flag;
  track: string;
  "track-component": number | string;
  "track-range": string;
  "track-colormap": "sequential" | "diverging";
}

/** Attributes of `<reel-player>` by their HTML names; all are optional. */
export type ReelPlayerMarkup = { [Name in AttributeName]?: Values[Name] | undefined };
