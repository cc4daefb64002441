// Positions of blocks without modes: exact, or places of a grid; docs/format.md, "Tracks".

import { CorruptStreamError } from "../errors.js";
import { type StoredBlock, blockPayload } from "../stream/block_sections.js";
import { ByteReader } from "../stream/byte_reader.js";
import type { Header } from "../stream/header.js";
import { Section } from "../stream/layout.js";
import type { ExactDecoder } from "./exact_values.js";
import { type Positions, requireFinite } from "./frames.js";
import { GRID } from "./methods.js";
import { NUMBER_TYPES, type NumberType } from "./number_types.js";

const COLUMNS = 3;

/** The number type of positions, as they go out. */
export function typeOfPositions({ vertexType }: Header): NumberType {
  return NUMBER_TYPES.get(vertexType)!;
}

/** Of what a grid numbers its places with. */
const PLACES = NUMBER_TYPES.get(36)!;

/**
 * Positions of a block, of shape (T, V, 3), in model units.
 *
 * @throws CorruptStreamError where the bytes are damaged, or positions are not finite.
 * @throws MeshReelError where the block is too large for a page.
 */
export function exactPositions(
  header: Header,
  stored: Omit<StoredBlock, "layout">,
  decoder: ExactDecoder,
): Positions {
  const { nFrames, nModes } = stored;
  if (nModes) {
    throw new CorruptStreamError(`a block has ${nModes} modes; exact positions have no modes`);
  }
  const payload = blockPayload(stored, Section.VALUES);
  const numbers = typeOfPositions(header);
  const isGrid = header.method === GRID;
  const step = isGrid ? readStep(payload) : 0;
  const rest = payload.subarray(isGrid ? 8 : 0);
  const found = decoder.decode(rest, nFrames, COLUMNS, step ? PLACES : numbers);
  const positions = step ? onGrid(header, step, found as Int32Array) : (found as Positions);
  requireFinite(positions, stored);
  return positions;
}

function readStep(payload: Uint8Array): number {
  const step = new ByteReader(payload).float64("the step of a grid is cut off");
  if (step >= 0 && step <= 1) return step;
  throw new CorruptStreamError(`the step of a grid is 0 to 1 diagonals; got ${step}`);
}

function onGrid(header: Header, step: number, places: Int32Array): Positions {
  const { origin, scale } = header;
  const { length } = places;
  const { sizeBytes, view } = typeOfPositions(header);
  const positions = view(new ArrayBuffer(sizeBytes * length), 0, length) as Positions;
  for (let i = 0; i < length; i++) positions[i] = places[i] * step * scale + origin[i % COLUMNS];
  return positions;
}
