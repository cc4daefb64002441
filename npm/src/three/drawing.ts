// Static geometry to draw: vertices, triangles, groups and attributes.

import type { Surface } from "../types.js";
import type { Split } from "./corners.js";
import { createDrawnVertices, type DrawnVertices } from "./drawn_vertices.js";

/** UV sets that three.js supports. */
export const MAX_UV_SETS = 4;

/** A range of the index with one material. */
export interface IndexRange {
  readonly start: number;
  readonly count: number;
  readonly materialIndex: number;
}

/** The drawn geometry of a surface. */
export interface Drawing extends DrawnVertices {
  /** One range per material, as triangles are sorted by material; empty without materials. */
  readonly groups: readonly IndexRange[];
  /** Triangle of the file of each drawn triangle; null if the order is the same. */
  readonly order: Uint32Array | null;
  /** Names of materials by `materialIndex`; null for faces without a material. */
  readonly materialNames: readonly (string | null)[];
  /** Names of the UV attributes of the file, by channel: `uv`, `uv1`, ... */
  readonly uvNames: readonly string[];
}

/**
 * Create the drawn geometry of a surface with `nVerts` vertices.
 *
 * @param split - split vertices so that each belongs to one face or corner, which `items` lists
 */
export function createDrawing(
  surface: Surface,
  nVerts: number,
  split: Split | null = null,
): Drawing {
  const uvs = surface.attributes.filter(({ kind }) => kind === "uv").slice(0, MAX_UV_SETS);
  const vertices = createDrawnVertices(surface, nVerts, uvs, split);
  const uvNames = uvs.map(({ name }) => name);
  return { ...vertices, ...sortByMaterial(surface, vertices.index), uvNames };
}

function sortByMaterial({ groups, faceSizes }: Surface, index: Uint32Array) {
  const materials = groups.find(({ name }) => name === "material");
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
