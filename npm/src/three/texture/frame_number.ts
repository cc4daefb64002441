// Reads frame numbers that are encoded as black and white cells in images of a video.

import { InvalidInputError } from "../../errors.js";

/**
 * Where images of a video encode their frame number: a row of square cells from left to right,
 * white for 1 and black for 0, most significant bit first, followed by a parity cell. The total
 * number of white cells is odd, so that a black image encodes no number.
 */
export interface FrameNumber {
  /** Left edge of the first cell, in pixels of the video. */
  readonly x: number;
  /** Top edge of the cells, in pixels of the video. */
  readonly y: number;
  /** Size of a cell, in pixels of the video: at least 4; 8 or more survive most video encoders. */
  readonly cell: number;
  /** Bits of a number, 1 to 30, without the parity cell. */
  readonly bits: number;
}

/** Brightness in 0..1 up to which a cell is black, and from which it is white. */
const [BLACK, WHITE] = [0.35, 0.65];

/** Smallest size of a cell whose center survives video encoders. */
const MIN_CELL = 4;

/** Keeps numbers positive in 32-bit integers. */
const MAX_BITS = 30;

/** @throws InvalidInputError if the layout of cells is invalid. */
export function checkFrameNumber({ x, y, cell, bits }: FrameNumber): void {
  const isIntegerInRange = (value: number, min: number, max: number) =>
    Number.isInteger(value) && value >= min && value <= max;
  const isInside = [x, y].every((value) => isIntegerInRange(value, 0, Infinity));
  if (isInside && isIntegerInRange(cell, MIN_CELL, Infinity) && isIntegerInRange(bits, 1, MAX_BITS)) return;
  throw new InvalidInputError(
    `frameNumber must have integers x >= 0, y >= 0, cell >= ${MIN_CELL} and bits from 1 to` +
      ` ${MAX_BITS}; got x ${x}, y ${y}, cell ${cell}, bits ${bits}`,
  );
}

/** Size of all cells in pixels. */
export function cellsSize({ cell, bits }: FrameNumber): { width: number; height: number } {
  return { width: cell * (bits + 1), height: cell };
}

/**
 * Read the number in the cells; null if a cell is neither black nor white, or the parity is wrong.
 *
 * @param pixels - RGBA of the pixels that the cells cover, row by row
 */
export function readFrameNumber(pixels: Uint8ClampedArray, { cell, bits }: FrameNumber): number | null {
  const width = cell * (bits + 1);
  let number = 0;
  let isOdd = false;
  for (let i = 0; i <= bits; i++) {
    const brightness = cellBrightness(pixels, width, cell * i, cell);
    if (brightness > BLACK && brightness < WHITE) return null;
    const isWhite = brightness >= WHITE;
    if (isWhite) isOdd = !isOdd;
    if (i < bits) number = 2 * number + Number(isWhite);
  }
  return isOdd ? number : null;
}

/** Mean brightness of the center of a cell, 0..1; video encoders blur its edges. */
function cellBrightness(
  pixels: Uint8ClampedArray,
  width: number,
  left: number,
  cell: number,
): number {
  const edge = Math.floor(cell / 4);
  let sum = 0;
  for (let y = edge; y < cell - edge; y++) {
    for (let x = edge; x < cell - edge; x++) {
      const offset = 4 * (y * width + left + x);
      sum += pixels[offset] + pixels[offset + 1] + pixels[offset + 2];
    }
  }
  return sum / (3 * 255 * (cell - 2 * edge) ** 2);
}
