// Color maps that are perceptually uniform and safe for color-blind viewers.

import * as THREE from "three";

import { InvalidInputError } from "../../errors.js";

/**
 * A color map: "sequential" from violet through blue and green to yellow, as in `meshreel render`;
 * "diverging" from blue through light gray to red; or a list of at least two colors, from the lowest
 * value to the highest.
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

/** Color of missing values. */
const MISSING_COLOR = [128, 128, 128] as const;

/** Width of a color texture. */
const N_COLORS = 256;

/**
 * Height of a color texture. The first row is the color map, all others have the color of missing
 * values: a triangle with a missing value at one corner is gray except close to the others.
 */
const N_ROWS = 64;

/** Colors of a map: red, green and blue in sRGB, 0..255. */
export type Colors = readonly (readonly [number, number, number])[];

/** Return the colors of a map. @throws InvalidInputError if it is neither a name nor a list of colors. */
export function resolveColorMap(map: ColorMap): Colors {
  const isName = typeof map === "string";
  const colors = isName ? MAPS[map]?.split(" ").map((hex) => parseInt(hex, 16)) : map;
  if (!Array.isArray(colors) || colors.length < 2) {
    throw new InvalidInputError(
      'map must be "sequential", "diverging" or a list of two or more colors; got ' +
      JSON.stringify(map),
    );
  }
  return colors.map((color) => {
    const hex = new THREE.Color(color).getHex(THREE.SRGBColorSpace);
    return [hex >> 16, (hex >> 8) & 255, hex & 255];
  });
}

/**
 * Resample a color map for a range that contains 0: the middle of the map moves to 0, and both
 * halves keep the same scale, so that the shorter side ends before the end of the map.
 */
export function centerAtZero(colors: Colors, low: number, high: number): Colors {
  const maxAbs = Math.max(-low, high);
  return Array.from({ length: N_COLORS }, (_, i) => {
    const value = low + ((high - low) * i) / (N_COLORS - 1);
    return colorAt(colors, (value / maxAbs + 1) / 2);
  });
}

/** Return the color at a position of a map, clamped to 0..1; gray for NaN. */
export function colorAt(colors: Colors, position: number): [number, number, number] {
  if (Number.isNaN(position)) return [...MISSING_COLOR];
  const at = Math.min(Math.max(position, 0), 1) * (colors.length - 1);
  const below = Math.min(Math.floor(at), colors.length - 2);
  const interpolate = (channel: number) => {
    const [low, high] = [colors[below][channel], colors[below + 1][channel]];
    return Math.round(low + (at - below) * (high - low));
  };
  return [interpolate(0), interpolate(1), interpolate(2)];
}

/** Create a texture of a color map; the caller disposes of it. */
export function createColorTexture(colors: Colors): THREE.DataTexture {
  const data = new Uint8Array(4 * N_COLORS * N_ROWS);
  for (let i = 0; i < N_COLORS * N_ROWS; i++) {
    const color = i < N_COLORS ? colorAt(colors, i / (N_COLORS - 1)) : MISSING_COLOR;
    data.set([...color, 255], 4 * i);
  }
  const texture = new THREE.DataTexture(data, N_COLORS, N_ROWS);
  texture.colorSpace = THREE.SRGBColorSpace;
  texture.minFilter = texture.magFilter = THREE.LinearFilter;
  texture.needsUpdate = true;
  return texture;
}

/** UVs of a position in the map are (position * U_SCALE + U_OFFSET, V_ROW). */
export const U_SCALE = (N_COLORS - 1) / N_COLORS;
export const U_OFFSET = 0.5 / N_COLORS;
export const V_ROW = 0.5 / N_ROWS;
/** UVs of a missing value. */
export const MISSING_UV = [0.5, 1] as const;

/** Return the UVs of a position in the map, clamped to 0..1; NaN is a missing value. */
export function colorUv(position: number): readonly number[] {
  if (Number.isNaN(position)) return MISSING_UV;
  return [Math.min(Math.max(position, 0), 1) * U_SCALE + U_OFFSET, V_ROW];
}
