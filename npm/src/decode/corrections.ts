// Corrections of single positions, so that an error bound can be promised.

import type { Core } from "../core/core.js";
import { CorruptStreamError } from "../errors.js";
import { isStep } from "../stream/block_sections.js";
import { ByteReader } from "../stream/byte_reader.js";
import { decodeIntegers } from "./integers.js";
import { DEFAULT_MEMORY, requireMemory } from "./memory.js";

/** Of a correction: its vertex, frame and offsets. */
const BYTES_OF_NUMBER = 8;

/** Corrections of a block, frame after frame, vertices ascending in each. */
export interface Corrections {
  /** Those of frame t are starts[t] .. starts[t + 1] - 1. */
  readonly starts: Uint32Array;
  /** Vertices as they go out. */
  readonly vertices: Int32Array;
  /** One for each column, in diagonals. */
  readonly moves: Float64Array;
}

/** The corrections of a block without any. */
export function noCorrections(nFrames: number): Corrections {
  const starts = new Uint32Array(nFrames + 1);
  return { starts, vertices: new Int32Array(0), moves: new Float64Array(0) };
}

/**
 * Corrections from the payload of their section.
 *
 * @param places - Number of each internal vertex as it goes out.
 * @param memory - Bytes that decoding may take at once.
 * @throws MemoryLimitError where there are more than allowed.
 * @throws CorruptStreamError where a vertex or frame is out of range, or the numbers do not fit
 * each other.
 */
export function readCorrections(
  core: Core,
  payload: Uint8Array,
  nColumns: number,
  nFrames: number,
  places: Int32Array,
  memory = DEFAULT_MEMORY,
): Corrections {
  const reader = new ByteReader(payload);
  const step = reader.float32("the corrections are cut off");
  const nCorrected = reader.varint();
  const count = reader.varint();
  const nVerts = places.length;
  if (!(nCorrected <= nVerts && nCorrected <= count && count <= nFrames * nVerts)) {
    throw new CorruptStreamError(
      `${count} corrections of ${nCorrected} vertices are announced, for ${nFrames} frames of ` +
        `${nVerts}`,
    );
  }
  requireMemory(memory, BYTES_OF_NUMBER * count * (nColumns + 3), `${count} corrections`);
  const columns = Array.from({ length: nColumns }, () => count);
  const lengths = [nCorrected, nCorrected, count, ...columns];
  const tables = [0, 1, 2, ...columns.map(() => 3)];
  const rows = decodeIntegers(core, reader.rest(), lengths, tables);
  const listed = listCorrections(rows, nFrames, places, isStep(step));
  return sorted(listed, rows.slice(3), step, nFrames);
}

/** Corrections in the order of the stream. */
interface Listed {
  readonly frames: Int32Array;
  readonly vertices: Int32Array;
  /** Whether the offset of each is a difference to the one before. */
  readonly follows: Uint8Array;
}

function listCorrections(
  [vertexSteps, counts, frameSteps]: readonly Int32Array[],
  nFrames: number,
  places: Int32Array,
  isSoundStep: boolean,
): Listed {
  const count = frameSteps.length;
  const found = {
    frames: new Int32Array(count),
    vertices: new Int32Array(count),
    follows: new Uint8Array(count),
  };
  let isSound = isSoundStep;
  let next = 0;
  let vertex = 0;
  for (let i = 0; i < vertexSteps.length; i++) {
    vertex += vertexSteps[i];
    isSound &&= vertex >= 0 && vertex < places.length && (i === 0 || vertexSteps[i] > 0);
    const end = next + counts[i] + 1;
    if (end <= next || end > count) throw wrongCount();
    for (let frame = 0, first = next; next < end; next++) {
      frame += frameSteps[next];
      isSound &&= frame >= 0 && frame < nFrames && (next === first || frameSteps[next] > 0);
      found.frames[next] = frame;
      found.vertices[next] = places[vertex];
      found.follows[next] = Number(next > first && frameSteps[next] === 1);
    }
  }
  if (next !== count) throw wrongCount();
  if (!isSound) {
    throw new CorruptStreamError(
      "a correction is of a vertex or frame that does not exist, or out of order",
    );
  }
  return found;
}

/** Corrections by frame, then by vertex. */
function sorted(
  { frames, vertices, follows }: Listed,
  columns: readonly Int32Array[],
  step: number,
  nFrames: number,
): Corrections {
  const count = frames.length;
  const width = columns.length;
  const moves = new Float64Array(width * count);
  columns.forEach((column, axis) => {
    let offset = 0;
    column.forEach((difference, i) => {
      offset = follows[i] ? offset + difference : difference;
      moves[width * i + axis] = offset * step;
    });
  });
  const order = Array.from({ length: count }, (_, i) => i).sort(
    (one, other) => frames[one] - frames[other] || vertices[one] - vertices[other],
  );
  const starts = new Uint32Array(nFrames + 1);
  for (const frame of frames) starts[frame + 1]++;
  for (let t = 0; t < nFrames; t++) starts[t + 1] += starts[t];
  const sortedMoves = new Float64Array(width * count);
  order.forEach((i, place) =>
    sortedMoves.set(moves.subarray(width * i, width * (i + 1)), width * place),
  );
  return { starts, vertices: Int32Array.from(order, (i) => vertices[i]), moves: sortedMoves };
}

function wrongCount(): CorruptStreamError {
  return new CorruptStreamError("the corrections of the vertices are not as many as announced");
}
