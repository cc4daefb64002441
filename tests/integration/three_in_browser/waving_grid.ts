// A waving grid as an open file with known values.

import type { BlockFields, OpenReel, Surface } from "../../../npm/src/types";
import { gridTrack, type TrackName } from "./grid_tracks";

export const COLUMNS = 24;
export const ROWS = 16;
const N_VERTS = COLUMNS * ROWS;
const FRAMES_OF_BLOCKS = [6, 5, 7];
const MODES_OF_BLOCKS = [7, 9, 4];
const STEP = 1 / 2000;
const SIZE = 4;

/** Fields of a block: x and y of the grid at rest, then waves. */
function fieldsOf(nModes: number): Int16Array {
  return Int16Array.from({ length: nModes * N_VERTS }, (_, i) => {
    const [mode, vertex] = [Math.floor(i / N_VERTS), i % N_VERTS];
    const x = (vertex % COLUMNS) / (COLUMNS - 1) - 0.5;
    const y = Math.floor(vertex / COLUMNS) / (ROWS - 1) - 0.5;
    if (mode === 0) return Math.round(x / STEP);
    if (mode === 1) return Math.round(y / STEP);
    return Math.round(Math.sin((mode + 1) * (x + 0.4 * y) * 2) / STEP);
  });
}

function weightsOf(start: number, nFrames: number, nModes: number): Float32Array {
  return Float32Array.from({ length: nFrames * nModes * 3 }, (_, i) => {
    const axis = i % 3;
    const mode = Math.floor(i / 3) % nModes;
    const frame = start + Math.floor(i / 3 / nModes);
    if (mode < 2) return axis === mode ? SIZE * STEP * (1 - 0.3 * mode) : 0;
    return axis === 2 ? (0.5 / mode) * STEP * Math.sin(frame * 0.4 + mode) : 0.02 * STEP * axis;
  });
}

function meanOf(fields: Int16Array, mode: number): number {
  const field = fields.subarray(mode * N_VERTS, (mode + 1) * N_VERTS);
  return field.reduce((sum, one) => sum + one, 0) / N_VERTS;
}

function blockOf(number: number): BlockFields {
  const [nFrames, nModes] = [FRAMES_OF_BLOCKS[number], MODES_OF_BLOCKS[number]];
  const start = FRAMES_OF_BLOCKS.slice(0, number).reduce((sum, one) => sum + one, 0);
  const vertices: number[] = [];
  const starts = [0];
  for (let t = 0; t < nFrames; t++) {
    // Some at every other frame; those of frames 2 and 4 share vertex 200.
    if (t % 2 === 0) vertices.push(t, 200, N_VERTS - 1 - t);
    starts.push(vertices.length);
  }
  const offsets = Float32Array.from({ length: 3 * vertices.length }, (_, i) => 0.1 * Math.cos(i));
  const fields = fieldsOf(nModes);
  return {
    index: number,
    start,
    nFrames,
    nModes,
    nVerts: N_VERTS,
    fields,
    means: Float64Array.from({ length: nModes }, (_, mode) => meanOf(fields, mode)),
    weights: weightsOf(start, nFrames, nModes),
    correctionStarts: Uint32Array.from(starts),
    correctionVertices: Uint32Array.from(vertices),
    correctionOffsets: offsets,
  };
}

const N_FRAMES = FRAMES_OF_BLOCKS.reduce((sum, one) => sum + one);
const BLOCKS = FRAMES_OF_BLOCKS.map((_, number) => blockOf(number));

/** Compute the positions of a frame in plain loops. */
function frameOf(frame: number, center: readonly number[]): Float64Array {
  const block = BLOCKS.findLast((one) => one.start <= frame) as BlockFields;
  const t = frame - block.start;
  const found = new Float64Array(3 * N_VERTS);
  for (let vertex = 0; vertex < N_VERTS; vertex++) {
    for (let axis = 0; axis < 3; axis++) {
      let sum = center[axis];
      for (let mode = 0; mode < block.nModes; mode++) {
        const weight = block.weights[(t * block.nModes + mode) * 3 + axis];
        sum += block.fields[mode * N_VERTS + vertex] * weight;
      }
      found[3 * vertex + axis] = sum;
    }
  }
  for (let i = block.correctionStarts[t]; i < block.correctionStarts[t + 1]; i++) {
    for (let axis = 0; axis < 3; axis++) {
      found[3 * block.correctionVertices[i] + axis] += block.correctionOffsets[3 * i + axis];
    }
  }
  return found;
}

/** Compute the positions at a time in frames. */
export function truth(place: number, center: readonly number[] = [0, 0, 0]): Float64Array {
  const frame = Math.min(Math.floor(place), N_FRAMES - 1);
  const here = frameOf(frame, center);
  if (place === frame) return here;
  const there = frameOf(frame + 1, center);
  return here.map((one, i) => one + (place - frame) * (there[i] - one));
}

/** Red on the left, a checkerboard of white and blue on the right. */
async function picture(): Promise<Uint8Array> {
  const canvas = new OffscreenCanvas(64, 64);
  const pen = canvas.getContext("2d") as OffscreenCanvasRenderingContext2D;
  for (let i = 0; i < 64; i++) {
    const [column, row] = [i % 8, i >> 3];
    pen.fillStyle = column < 2 ? "#f00" : (column + row) % 2 ? "#fff" : "#00f";
    pen.fillRect(8 * column, 8 * row, 8, 8);
  }
  pen.fillStyle = "#0f0"; // at the top
  pen.fillRect(0, 0, 64, 8);
  return new Uint8Array(await (await canvas.convertToBlob()).arrayBuffer());
}

/** Triangles of the grid; texture coordinates of corners have a seam in the middle. */
async function surfaceOf(): Promise<Surface> {
  const triangles: number[] = [];
  const uv: number[] = [];
  const materials: number[] = [];
  for (let row = 0; row + 1 < ROWS; row++) {
    for (let column = 0; column + 1 < COLUMNS; column++) {
      const at = row * COLUMNS + column;
      const cell = [at, at + 1, at + COLUMNS + 1, at, at + COLUMNS + 1, at + COLUMNS];
      triangles.push(...cell);
      const isRight = 2 * column >= COLUMNS;
      for (const vertex of cell) {
        const u = (vertex % COLUMNS) / (COLUMNS - 1);
        uv.push(isRight ? 1 - u : u, Math.floor(vertex / COLUMNS) / (ROWS - 1));
      }
      const material = row < 4 ? 1 : row < 6 ? -1 : 0;
      materials.push(material, material);
    }
  }
  const look = {
    alphaMode: "opaque",
    doubleSided: true,
    unlit: false,
    metallic: 0,
    roughness: 0.7,
    emissive: [0, 0, 0],
    normalScale: 1,
    occlusionStrength: 1,
    alphaCutoff: 0.5,
  } as const;
  const texture = {
    slot: "baseColor",
    image: 0,
    uv: "uv",
    offset: [0, 0],
    rotation: 0,
    scale: [1, 1],
    wrapU: 0,
    wrapV: 0,
  } as const;
  return {
    triangles: Uint32Array.from(triangles),
    faceSizes: null,
    triangleCorners: null,
    attributes: [
      { name: "uv", kind: "uv", domain: "corner", width: 2, values: Float32Array.from(uv) },
    ],
    groups: [{ name: "material", labels: ["board", "hem"], faceLabels: Int32Array.from(materials) }],
    materials: [
      { ...look, name: "board", baseColor: [1, 1, 1, 1], textures: [texture] },
      { ...look, name: "hem", baseColor: [0.1, 0.02, 0.3, 1], textures: [] },
    ],
    images: [{ name: "board", mediaType: "image/png", sizeBytes: (await picture()).length }],
  };
}

/** Options of the grid. */
export interface GridOptions {
  center?: readonly [number, number, number];
  /** Numbers of blocks whose bytes are damaged. */
  damaged?: readonly number[];
  isPlain?: boolean;
  /** Whether faces are quads instead of triangles. */
  hasQuads?: boolean;
  /** Numbers of blocks in which tracks are damaged. */
  damagedTracks?: readonly number[];
}

/** The grid as an open file. */
export async function wavingGrid(options: GridOptions = {}): Promise<OpenReel> {
  const center = options.center ?? [0, 0, 0];
  const triangular = await surfaceOf();
  const nQuads = triangular.triangles.length / 6;
  const faceSizes = options.hasQuads ? new Uint32Array(nQuads).fill(4) : null;
  const corners = triangular.triangles.map((_, i) => 4 * Math.floor(i / 6) + [0, 1, 2, 0, 2, 3][i % 6]);
  const surface = { ...triangular, faceSizes, triangleCorners: faceSizes && corners };
  const bare = { ...surface, attributes: [], groups: [], materials: [], images: [] };
  let low = [Infinity, Infinity, Infinity];
  let high = [-Infinity, -Infinity, -Infinity];
  for (let frame = 0; frame < N_FRAMES; frame++) {
    frameOf(frame, [0, 0, 0]).forEach((value, i) => {
      low = low.with(i % 3, Math.min(low[i % 3], value));
      high = high.with(i % 3, Math.max(high[i % 3], value));
    });
  }
  return {
    info: {
      name: "grid",
      nFrames: N_FRAMES,
      nVerts: N_VERTS,
      nFaces: surface.triangles.length / 3,
      fps: 10,
      startS: 0,
      center,
      diagonal: Math.hypot(...high.map((one, axis) => one - low[axis])),
      errorBoundPercent: null,
      numberType: "float32",
      tracks: [],
      blocks: BLOCKS.map(({ start, nFrames }) => ({ start, nFrames, sizeBytes: 1000 })),
    },
    surface: options.isPlain ? bare : surface,
    frame: async (number) => Float32Array.from(frameOf(number, center)),
    fields: async (number) => {
      if (options.damaged?.includes(number)) {
        throw Object.assign(new Error(`block ${number}`), { name: "CorruptStreamError" });
      }
      return structuredClone(BLOCKS[number]);
    },
    image: () => picture(),
    track: (name) =>
      gridTrack(name as TrackName, surface, BLOCKS, [COLUMNS, ROWS], options.damagedTracks),
    close() {},
  };
}
