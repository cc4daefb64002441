// The static part of what is drawn: vertices, triangles, groups and attributes.

import type { Surface } from "../types.js";
import type { NormalRows } from "./normal_rows.js";

/** UV sets that three.js supports. */
const MAX_UV_SETS = 4;

/** A range of the index with one material. */
export interface IndexRange {
  readonly start: number;
  readonly count: number;
  readonly materialIndex: number;
}

/** An attribute in the layout of the GPU. */
export interface VertexAttribute {
  /** Name in the geometry, such as "uv". */
  readonly name: string;
  /** Numbers per vertex. */
  readonly width: number;
  readonly values: Float32Array;
}

/** The drawn vertices of a surface. */
export interface DrawnVertices extends NormalRows {
  /** Vertex of the file of each drawn vertex. */
  readonly sources: Uint32Array;
  /** Three vertices per triangle. */
  readonly index: Uint32Array;
  readonly attributes: readonly VertexAttribute[];
  /** Item of each vertex in the domain of the split: vertex, face or corner of the file. */
  readonly items: Uint32Array;
  /** Normal row of each vertex: its vertex of the file if there are no hard edges. */
  readonly rows: Uint32Array;
}

/** The drawn geometry of a surface. */
export interface Drawing extends DrawnVertices {
  /** Whether the script was loaded that the surface needs. */
  readonly isComplete: boolean;
  /** Triangles are sorted by material; empty if there are no materials. */
  readonly groups: readonly IndexRange[];
  /** Triangle of the file of each drawn triangle; null if the order is the same. */
  readonly order: Uint32Array | null;
  /** Names of materials by `materialIndex`; null for faces without a material. */
  readonly materialNames: readonly (string | null)[];
  /** Names of the UV attributes of the file, by channel: `uv`, `uv1`, ... */
  readonly uvNames: readonly string[];
}

let script: typeof import("./split_drawing.js") | null = null;

/** Load the script of attributes and split vertices, if the drawing of a surface needs it. */
export async function prepareDrawing(surface: Surface, isSplit = false): Promise<void> {
  if (needsScript(surface, isSplit)) script ??= await import("./split_drawing.js");
}

function needsScript({ attributes, hardEdges }: Surface, isSplit: boolean): boolean {
  return isSplit || hardEdges !== null || attributes.length > 0;
}

/**
 * Create the drawn geometry of a surface with `nVerts` vertices. Before `prepareDrawing`, it has no
 * attributes, and no vertices are split.
 *
 * @param split - split vertices so that each belongs to one face or corner; `items` has which
 */
export function createDrawing(
  surface: Surface,
  nVerts: number,
  split: "face" | "corner" | null = null,
): Drawing {
  const { triangles, attributes } = surface;
  const sources = Uint32Array.from({ length: nVerts }, (_, vertex) => vertex);
  const unsplit: DrawnVertices = {
    ...{ sources, items: sources, rows: sources, nRows: nVerts },
    ...{ index: triangles, cornerRows: triangles, attributes: [] },
  };
  const uvs = attributes.filter((one) => one.kind === "uv").slice(0, MAX_UV_SETS);
  const isScripted = needsScript(surface, split !== null);
  const vertices = isScripted && script ? script.createSplitVertices(surface, uvs, split, unsplit) : unsplit;
  return {
    ...vertices,
    ...sortByMaterial(surface, vertices.index),
    uvNames: uvs.map(({ name }) => name),
    isComplete: !isScripted || script !== null,
  };
}

function sortByMaterial({ groups, faceSizes }: Surface, index: Uint32Array) {
  const materials = groups.find((one) => one.name === "material");
  if (!materials) return { index, groups: [], order: null, materialNames: [null] };
  const materialNames = [...materials.labels, null];
  const triangles: number[][] = materialNames.map(() => []);
  let end = 0;
  materials.faceLabels.forEach((label, face) => {
    const ofMaterial = triangles[label] ?? triangles[materials.labels.length];
    const start = end;
    end += (faceSizes?.[face] ?? 3) - 2;
    for (let triangle = start; triangle < end; triangle++) ofMaterial.push(triangle);
  });
  const order = Uint32Array.from(triangles.flat());
  const sorted = index.map((_, i) => index[3 * order[Math.floor(i / 3)] + (i % 3)]);
  let start = 0;
  const ranges = triangles.map(({ length }, materialIndex) => {
    const range = { start, count: 3 * length, materialIndex };
    start += range.count;
    return range;
  });
  return { index: sorted, groups: ranges.filter(({ count }) => count), order, materialNames };
}
