// The static part of what is drawn: vertices, triangles, groups and attributes.

import type { Attribute, Surface } from "../types.js";
import { type DomainLookup, createItemLookup } from "./corners.js";
import { type NormalRows, createNormalRows } from "./normal_rows.js";
import { type VertexColumn, type SplitVertices, splitAtSeams } from "./seams.js";

/** UV sets that three.js supports. */
const MAX_UV_SETS = 4;

/** A range of the index with one material. */
export interface IndexRange {
  readonly start: number;
  readonly count: number;
  readonly materialIndex: number;
}

/** The drawn geometry of a surface. */
export interface Drawing extends SplitVertices {
  /** Triangles are sorted by material; empty if there are no materials. */
  readonly groups: readonly IndexRange[];
  /** Triangle of the file of each drawn triangle; null if the order is the same. */
  readonly order: Uint32Array | null;
  /** Names of materials by `materialIndex`; null for faces without a material. */
  readonly materialNames: readonly (string | null)[];
  /** Names of the UV attributes of the file, by channel: `uv`, `uv1`, ... */
  readonly uvNames: readonly string[];
  /** Item of each vertex in the domain of the split: vertex, face or corner of the file. */
  readonly items: Uint32Array;
  /** Normal row of each vertex: its vertex of the file if there are no hard edges. */
  readonly rows: Uint32Array;
  /** Normal rows of a mesh with hard edges, else null. */
  readonly shading: NormalRows | null;
}

/**
 * Create the drawn geometry of a surface with `nVerts` vertices.
 *
 * @param split - split vertices so that each belongs to one face or corner; `items` has which
 */
export function createDrawing(
  surface: Surface,
  nVerts: number,
  split: "face" | "corner" | null = null,
): Drawing {
  const corners = createItemLookup(surface);
  const uvs = surface.attributes.filter((one) => one.kind === "uv").slice(0, MAX_UV_SETS);
  const columns = uvs.map(uvColumn);
  const color = surface.attributes.find((one) => one.kind === "color");
  if (color) columns.push(colorColumn(color));
  const nAttributes = columns.length;
  const shading = createNormalRows(surface, nVerts);
  if (shading) columns.push(indexColumn("corner", shading.cornerRows));
  if (split) columns.push(itemColumn(split, surface));
  const { attributes, ...vertices } = splitAtSeams(surface.triangles, nVerts, corners, columns);
  const indicesAt = (column: number) => new Uint32Array(attributes[column].values.buffer);
  return {
    ...vertices,
    attributes: attributes.slice(0, nAttributes),
    items: split ? indicesAt(attributes.length - 1) : vertices.sources,
    rows: shading ? indicesAt(nAttributes) : vertices.sources,
    shading,
    ...sortByMaterial(surface, corners, vertices.index),
    uvNames: uvs.map((uv) => uv.name),
  };
}

/** A column with the index of each face or corner, which splits all vertices between them. */
function itemColumn(domain: "face" | "corner", { faceSizes, triangles }: Surface): VertexColumn {
  const nTriangles = triangles.length / 3;
  const nFaces = faceSizes?.length ?? nTriangles;
  const count = domain === "face" ? nFaces : nTriangles + 2 * nFaces;
  return indexColumn(domain, Uint32Array.from({ length: count }, (_, number) => number));
}

/** A column with the bits of integers as floats: columns are compared by bits only. */
function indexColumn(domain: "face" | "corner", numbers: Uint32Array<ArrayBuffer>): VertexColumn {
  return { name: "", domain, width: 1, values: new Float32Array(numbers.buffer) };
}

function uvColumn(attribute: Attribute, number: number): VertexColumn {
  const { domain, width, values } = attribute;
  const uv = new Float32Array((values.length / width) * 2);
  for (let i = 0; i < uv.length; i++) {
    uv[i] = i % 2 < width ? values[(i >> 1) * width + (i % 2)] : 0;
  }
  return { name: `uv${number || ""}`, domain, width: 2, values: uv };
}

/** Convert colors from sRGB to linear, as three.js expects; opacity is unchanged. */
function colorColumn({ domain, width, values }: Attribute): VertexColumn {
  const channels = width === 4 ? 4 : 3;
  const maxValue = values instanceof Uint8Array ? 255 : 1;
  const colors = new Float32Array((values.length / width) * channels);
  for (let i = 0; i < colors.length; i++) {
    const channel = i % channels;
    const from = Math.floor(i / channels) * width + (width < 3 ? 0 : channel);
    const value = Math.min(Math.max(values[from] / maxValue || 0, 0), 1);
    colors[i] = channel === 3 ? value : srgbToLinear(value);
  }
  return { name: "color", domain, width: channels, values: colors };
}

function srgbToLinear(value: number): number {
  return value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
}

function sortByMaterial(surface: Surface, corners: DomainLookup, index: Uint32Array) {
  const groups = surface.groups.find((one) => one.name === "material");
  if (!groups) return { index, groups: [], order: null, materialNames: [null] };
  const materialNames = [...groups.labels, null];
  const triangles: number[][] = materialNames.map(() => []);
  const faceOf = corners("face");
  for (let triangle = 0; 3 * triangle < index.length; triangle++) {
    const label = groups.faceLabels[faceOf(3 * triangle)];
    (triangles[label] ?? triangles[groups.labels.length]).push(triangle);
  }
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
