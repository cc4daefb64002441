// From numbers to colours: maps whose steps look alike everywhere, for every kind of vision.

import * as THREE from "three";

import { InvalidInputError } from "../../errors.js";

/**
 * A map of colours: "sequential" from violet over blue and green to yellow, as in the pictures of
 * `meshreel render`; "diverging" from blue over light grey to red, alike to both sides; or at least
 * two colours of your own, from the lowest number to the highest.
 */
export type ColorMap = "sequential" | "diverging" | readonly THREE.ColorRepresentation[];

const MAPS = {
  sequential:
    "412b78 433987 424795 3e57a2 3966aa 3776ac 3685ad 2f95af 2ea4ac 3eb1a6 50bea0 5ccc97 71d889" +
    " 93e17a b7e86d d9ed62 faf25e",
  diverging:
    "06489c 2b5ea8 4773b3 6287be 7d9bc8 99b0d2 b5c5dc d1d9e5 eeeeee e5d4d2 dbbbb6 d0a19b c48880" +
    " b86f66 aa564c 9c3b33 8d1b17",
};

/** What has no number. */
const MISSING = [128, 128, 128] as const;

/** Colours of a texture, along a row. */
const N_COLORS = 256;

/**
 * Rows of a texture: the first has the colours, all others are of what has no number. A triangle one
 * of whose corners has none so turns grey just beside the others.
 */
const N_ROWS = 64;

/** Colours of a map, red, green and blue as screens show them, 0..255. */
export type Colors = readonly (readonly [number, number, number])[];

/** @throws InvalidInputError where a map is neither a name nor two colours. */
export function colorsOf(map: ColorMap): Colors {
  const isName = typeof map === "string";
  const given = isName ? MAPS[map]?.split(" ").map((one) => `#${one}`) : map;
  if (!Array.isArray(given) || given.length < 2) {
    throw new InvalidInputError(
      'map must be "sequential", "diverging" or a list of two or more colours; got ' +
        JSON.stringify(map),
    );
  }
  return given.map((one) => {
    const hex = new THREE.Color(one).getHex(THREE.SRGBColorSpace);
    return [hex >> 16, (hex >> 8) & 255, hex & 255];
  });
}

/**
 * Those of a map about 0, as far as a range goes: what is in its middle stays at 0, and both sides
 * are as far from it as the farther end.
 */
export function about0(colors: Colors, low: number, high: number): Colors {
  const most = Math.max(-low, high);
  return Array.from({ length: N_COLORS }, (_, i) => {
    const value = low + ((high - low) * i) / (N_COLORS - 1);
    return colorAt(colors, (value / most + 1) / 2);
  });
}

/** The colour at a place of a map, 0..1; places outside are those at its ends. */
export function colorAt(colors: Colors, place: number): [number, number, number] {
  if (Number.isNaN(place)) return [...MISSING];
  const at = Math.min(Math.max(place, 0), 1) * (colors.length - 1);
  const below = Math.min(Math.floor(at), colors.length - 2);
  const mixed = (channel: number) => {
    const [low, high] = [colors[below][channel], colors[below + 1][channel]];
    return Math.round(low + (at - below) * (high - low));
  };
  return [mixed(0), mixed(1), mixed(2)];
}

/** Colours as a texture; whoever asks disposes of it. */
export function textureOf(colors: Colors): THREE.DataTexture {
  const data = new Uint8Array(4 * N_COLORS * N_ROWS);
  for (let i = 0; i < N_COLORS * N_ROWS; i++) {
    const color = i < N_COLORS ? colorAt(colors, i / (N_COLORS - 1)) : MISSING;
    data.set([...color, 255], 4 * i);
  }
  const texture = new THREE.DataTexture(data, N_COLORS, N_ROWS);
  texture.colorSpace = THREE.SRGBColorSpace;
  texture.minFilter = texture.magFilter = THREE.LinearFilter;
  texture.needsUpdate = true;
  return texture;
}

/** Texture coordinates of places are (place * SCALE + OFFSET, ROW); of what has no number, NOWHERE. */
export const SCALE = (N_COLORS - 1) / N_COLORS;
export const OFFSET = 0.5 / N_COLORS;
export const ROW = 0.5 / N_ROWS;
export const NOWHERE = [0.5, 1] as const;
