// Types of the attributes of a player in JSX.

import type { AttributeName, ATTRIBUTES } from "./settings.js";

/** A boolean attribute. React 18 renders `true` as the text "true": pass "" instead. */
type Flag = boolean | "";

/** Values by the types of attributes. */
interface Values {
  text: string;
  flag: Flag;
  number: number | string;
  loop: Flag | "repeat" | "pingpong";
  switch: boolean | "true" | "false";
}

/** Attributes with more specific values. */
interface Choices {
  loading: "eager" | "lazy";
  up: "y" | "z";
  "texture-kind": "image" | "video";
  "track-component": number | string;
  "track-colormap": "sequential" | "diverging";
}

/** Attributes of `<reel-player>` by their HTML names; all are optional. */
export type ReelPlayerMarkup = {
  [Name in AttributeName]?:
    | (Name extends keyof Choices ? Choices[Name] : Values[(typeof ATTRIBUTES)[Name]])
    | undefined;
};
