// How much memory decoding may take at once: a limit that whoever opens a file sets. A few bytes may
// announce any number of values; the limit is compared with what they announce before anything is
// allocated for it.

import { MemoryLimitError } from "../errors.js";
import type { StoredBlock } from "../stream/block_sections.js";
import type { Header } from "../stream/header.js";

/** The limit where none is given, in bytes: 2 GiB. */
export const DEFAULT_MEMORY = 2 ** 31;

/** Of a mesh while it is decoded: connectivity, order and the hierarchy of its vertices. */
const BYTES_OF_VERTEX = 512;
const BYTES_OF_FACE = 128;

/** Of each decoded value of a mode, at a vertex or over time: as it is, and packed for products. */
const BYTES_OF_FIELD = 16;

/**
 * Refuses what is larger than allowed.
 *
 * @param memory - Bytes that are allowed.
 * @param what - Begins the message, such as "block 3 of 12 frames".
 * @throws MemoryLimitError where it is; names both sizes, and how to raise the limit.
 */
export function requireMemory(memory: number, neededBytes: number, what: string): void {
  if (neededBytes <= memory) return;
  throw new MemoryLimitError(
    `${what} takes ${neededBytes} bytes of memory; ${memory} are allowed: open it with more \`memory\``,
  );
}

/** The same of a mesh. */
export function requireMesh(memory: number, { nVerts, nFaces }: Header): void {
  const needed = BYTES_OF_VERTEX * nVerts + BYTES_OF_FACE * nFaces;
  requireMemory(memory, needed, `the mesh`);
}

/**
 * The same of a block.
 *
 * @param numberBytes - Of values that are decoded for all frames; 0 where they are decoded frame by
 *   frame.
 */
export function requireBlock(
  memory: number,
  { number, nFrames, nModes }: Pick<StoredBlock, "number" | "nFrames" | "nModes">,
  [nItems, nColumns]: readonly [nItems: number, nColumns: number],
  numberBytes: number,
): void {
  const values = nFrames * nItems * nColumns * numberBytes;
  const modes = BYTES_OF_FIELD * nModes * (nItems + nColumns * nFrames);
  requireMemory(memory, values + modes, `block ${number} of ${nFrames} frames`);
}
