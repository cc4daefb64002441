// The number of a frame as black and white cells in a picture.

import { InvalidInputError } from "../../errors.js";

/**
 * Where pictures of a video hold the number of their frame: a row of square cells from left to
 * right, white for 1 and black for 0, most significant bit first. One more cell follows, white
 * where the number of white cells before it is even: white cells are odd in number, so that a black
 * picture holds no number.
 */
export interface FrameNumber {
  /** Left edge of the first cell, in pixels of the video. */
  readonly x: number;
  /** Upper edge of the cells, in pixels of the video. */
  readonly y: number;
  /** Side of a cell, in pixels of the video; at least 4, and 8 or more survive most encoders. */
  readonly cell: number;
  /** Bits of a number, 1 to 30; the cell of parity is not counted. */
  readonly bits: number;
}

/** Brightness, 0 to 1, up to which a cell is black, and from which on it is white. */
const [BLACK, WHITE] = [0.35, 0.65];

/** Smallest cell whose middle encoders leave alone. */
const LEAST_CELL = 4;

/** So that numbers are positive in 32 bits. */
const MOST_BITS = 30;

/** @throws InvalidInputError where cells cannot be as they are said to be. */
export function checkFrameNumber({ x, y, cell, bits }: FrameNumber): void {
  const isWhole = (value: number, least: number, most: number) =>
    Number.isInteger(value) && value >= least && value <= most;
  const places = [x, y].every((value) => isWhole(value, 0, Infinity));
  if (places && isWhole(cell, LEAST_CELL, Infinity) && isWhole(bits, 1, MOST_BITS)) return;
  throw new InvalidInputError(
    `frameNumber must have x and y from 0 on, cell from ${LEAST_CELL} on and bits from 1 to` +
      ` ${MOST_BITS}, all of them whole; got x ${x}, y ${y}, cell ${cell}, bits ${bits}`,
  );
}

/** Pixels that the cells cover. */
export function sizeOf({ cell, bits }: FrameNumber): { width: number; height: number } {
  return { width: cell * (bits + 1), height: cell };
}

/**
 * The number that cells hold; null where one is neither black nor white, or their parity is wrong.
 *
 * @param pixels - red, green, blue and opacity of each pixel that the cells cover, row by row
 */
export function numberIn(pixels: Uint8ClampedArray, { cell, bits }: FrameNumber): number | null {
  const width = cell * (bits + 1);
  let number = 0;
  let isOdd = false;
  for (let i = 0; i <= bits; i++) {
    const brightness = brightnessOf(pixels, width, cell * i, cell);
    if (brightness > BLACK && brightness < WHITE) return null;
    const isWhite = brightness >= WHITE;
    if (isWhite) isOdd = !isOdd;
    if (i < bits) number = 2 * number + Number(isWhite);
  }
  return isOdd ? number : null;
}

/** Mean of the middle of a cell, 0 to 1: encoders blur its edges. */
function brightnessOf(
  pixels: Uint8ClampedArray,
  width: number,
  left: number,
  cell: number,
): number {
  const edge = Math.floor(cell / 4);
  let sum = 0;
  for (let y = edge; y < cell - edge; y++) {
    for (let x = edge; x < cell - edge; x++) {
      const at = 4 * (y * width + left + x);
      sum += pixels[at] + pixels[at + 1] + pixels[at + 2];
    }
  }
  return sum / (3 * 255 * (cell - 2 * edge) ** 2);
}
