// Tracks of the waving grid with known values.

import type { BlockFields, OpenTrack, Surface, TrackFields } from "../../../npm/src/types";

const STEP = 1 / 20000;
const N_MODES = 3;

/** The item whose value is missing in all frames. */
export const MISSING = 40;

/** Tracks by name. */
export const TRACKS = {
  scalar: { domain: "vertex", nColumns: 1, origin: [0] },
  high: { domain: "vertex", nColumns: 1, origin: [5e6] },
  vector: { domain: "vertex", nColumns: 3, origin: [0.5, 0, -2] },
  many: { domain: "vertex", nColumns: 5, origin: [0, 1, 2, 3, 4] },
  faces: { domain: "face", nColumns: 1, origin: [0] },
  corners: { domain: "corner", nColumns: 2, origin: [0, 0] },
} as const;

export type TrackName = keyof typeof TRACKS;

/** Vertex and face of each item of a domain. */
function itemsOf(domain: string, nVerts: number, { triangles, faceSizes }: Surface) {
  if (domain === "vertex") {
    return Array.from({ length: nVerts }, (_, vertex) => ({ vertex, face: 0 }));
  }
  const found: { vertex: number; face: number }[] = [];
  const sizes = faceSizes ?? Array.from({ length: triangles.length / 3 }, () => 3);
  let triangle = 0;
  for (let face = 0; face < sizes.length; face++) {
    const corners = [...triangles.slice(3 * triangle, 3 * triangle + 2)];
    for (let i = 0; i < sizes[face] - 2; i++) corners.push(triangles[3 * triangle++ + 2]);
    for (const vertex of domain === "face" ? corners.slice(0, 1) : corners) {
      found.push({ vertex, face });
    }
  }
  return found;
}

/** Some columns of the fields of a block. */
function columnsOf(block: TrackFields, wanted?: readonly number[]): TrackFields {
  if (!wanted) return block;
  const { nColumns, origin, weights, correctionOffsets } = block;
  const chosen = (rows: Float32Array) =>
    Float32Array.from({ length: (rows.length / nColumns) * wanted.length }, (_, i) => {
      const [row, column] = [Math.floor(i / wanted.length), wanted[i % wanted.length]];
      return rows[row * nColumns + column];
    });
  return {
    ...block,
    nColumns: wanted.length,
    origin: wanted.map((column) => origin[column]),
    weights: chosen(weights),
    correctionOffsets: chosen(correctionOffsets),
  };
}

/** A track of an open file; its `damaged` blocks cannot be decoded. */
export function gridTrack(
  name: TrackName,
  surface: Surface,
  blocks: readonly BlockFields[],
  [columns, rows]: [columns: number, rows: number],
  damaged: readonly number[] = [],
): OpenTrack {
  const { domain, nColumns, origin } = TRACKS[name];
  const items = itemsOf(domain, columns * rows, surface);
  const nItems = items.length;
  const fields = new Int16Array(N_MODES * nItems);
  items.forEach(({ vertex, face }, i) => {
    const [x, y] = [(vertex % columns) / columns, Math.floor(vertex / columns) / rows];
    fields[i] = Math.round(Math.sin(3 * x + 2 * y) / STEP);
    fields[nItems + i] = Math.round(Math.cos(4 * y - x) / STEP);
    fields[2 * nItems + i] = (face % 2) / STEP;
  });
  const block = (number: number): TrackFields => {
    const { start, nFrames } = blocks[number];
    const weights = Float32Array.from({ length: nFrames * N_MODES * nColumns }, (_, i) => {
      const [column, mode] = [i % nColumns, Math.floor(i / nColumns) % N_MODES];
      const frame = start + Math.floor(i / nColumns / N_MODES);
      return STEP * Math.cos(0.3 * frame + mode + column);
    });
    const corrected = Array.from({ length: nFrames }, () => [3, MISSING]).flat();
    return {
      ...{ index: number, start, nFrames, nModes: N_MODES, nVerts: nItems },
      ...{ nColumns, origin, fields: fields.slice(), weights },
      means: new Float64Array(N_MODES),
      correctionStarts: Uint32Array.from({ length: nFrames + 1 }, (_, t) => 2 * t),
      correctionVertices: Uint32Array.from(corrected),
      correctionOffsets: Float32Array.from(
        corrected.flatMap((item) => Array(nColumns).fill(item === MISSING ? NaN : 0.25)),
      ),
    };
  };
  return {
    info: {
      ...{ name, unit: "Pa", kind: "other", domain, nColumns, nItems },
      ...{ numberType: "float64", sizeBytes: 1000 },
    },
    frame: async (number) => {
      const { start, weights, correctionVertices, correctionOffsets } = block(
        blocks.findLastIndex((one) => one.start <= number),
      );
      const found = new Float64Array(nItems * nColumns);
      for (let i = 0; i < found.length; i++) {
        const [item, column] = [Math.floor(i / nColumns), i % nColumns];
        found[i] = origin[column];
        for (let mode = 0; mode < N_MODES; mode++) {
          const weight = weights[((number - start) * N_MODES + mode) * nColumns + column];
          found[i] += fields[mode * nItems + item] * weight;
        }
      }
      [0, 1].forEach((place) => {
        for (let column = 0; column < nColumns; column++) {
          found[correctionVertices[place] * nColumns + column] +=
            correctionOffsets[place * nColumns + column];
        }
      });
      return found;
    },
    fields: async (number, { columns: wanted } = {}) => {
      if (!damaged.includes(number)) return columnsOf(block(number), wanted);
      throw Object.assign(new Error(`track in block ${number}`), { name: "CorruptStreamError" });
    },
  };
}
