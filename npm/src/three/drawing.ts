// The static part of what is drawn: vertices, triangles, groups and attributes.

import type { Attribute, Surface } from "../types.js";
import { createItemLookup, type ItemLookup } from "./corners.js";
import { type NormalRows, createNormalRows } from "./normal_rows.js";
import { splitVertices } from "./split_vertices.js";

/** UV sets that three.js supports. */
const MAX_UV_SETS = 4;

/** A range of the index with one material. */
export interface IndexRange {
  readonly start: number;
  readonly count: number;
  readonly materialIndex: number;
}

/** An attribute in the layout of the GPU. */
interface VertexAttribute {
  /** Name in the geometry, such as "uv". */
  readonly name: string;
  /** Numbers per vertex. */
  readonly width: number;
  readonly values: Float32Array;
}

/** Such an attribute with a value per item of a domain. */
interface DomainAttribute extends VertexAttribute {
  readonly domain: Attribute["domain"];
}

/** The drawn geometry of a surface. */
export interface Drawing extends NormalRows {
  /** Vertex of the file of each drawn vertex. */
  readonly sources: Uint32Array;
  /** Three vertices per triangle. */
  readonly index: Uint32Array;
  readonly attributes: readonly VertexAttribute[];
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
  const { triangles } = surface;
  const lookup = createItemLookup(surface);
  const ofKind = (kind: Attribute["kind"]) => surface.attributes.filter((one) => one.kind === kind);
  const uvs = ofKind("uv").slice(0, MAX_UV_SETS);
  const colors = ofKind("color").slice(0, 1);
  const columns = [...uvs.map(uvColumn), ...colors.map(colorColumn)];
  const normalRows = createNormalRows(surface, nVerts, lookup("corner"));
  const shared = { ...normalRows, uvNames: uvs.map((uv) => uv.name) };
  const { cornerRows } = normalRows;
  if (!split && cornerRows === triangles && columns.every(({ domain }) => domain === "vertex")) {
    const sources = Uint32Array.from({ length: nVerts }, (_, vertex) => vertex);
    const drawing = { ...shared, sources, items: sources, rows: sources, attributes: columns };
    return { ...drawing, ...sortByMaterial(surface, lookup("face"), triangles) };
  }
  const cornerItems = split ? triangles.map((_, corner) => lookup(split)(corner)) : triangles;
  const atCorners = [triangles, cornerRows, cornerItems].map((values) => {
    return { width: 1, values, itemOf: (corner: number) => corner };
  });
  const atItems = columns.map((column) => ({ ...column, itemOf: lookup(column.domain) }));
  const { index, firstCorners } = splitVertices([...atCorners, ...atItems], triangles.length);
  const [sources, rows, items] = atCorners.map(({ values }) => firstCorners.map((corner) => values[corner]));
  const attributes = atItems.map(({ name, values, width, itemOf }) => {
    const drawn = new Float32Array(firstCorners.length * width);
    firstCorners.forEach((corner, i) => {
      const from = width * itemOf(corner);
      drawn.set(values.subarray(from, from + width), width * i);
    });
    return { name, width, values: drawn };
  });
  const drawing = { ...shared, sources, items, rows, attributes };
  return { ...drawing, ...sortByMaterial(surface, lookup("face"), index) };
}

function uvColumn(attribute: Attribute, number: number): DomainAttribute {
  const { domain, width, values } = attribute;
  const uv = new Float32Array((values.length / width) * 2);
  for (let i = 0; i < uv.length; i++) {
    uv[i] = i % 2 < width ? values[(i >> 1) * width + (i % 2)] : 0;
  }
  return { name: `uv${number || ""}`, domain, width: 2, values: uv };
}

/** Convert colors from sRGB to linear, as three.js expects; opacity is unchanged. */
function colorColumn({ domain, width, values }: Attribute): DomainAttribute {
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

function sortByMaterial(surface: Surface, faceOf: ItemLookup, index: Uint32Array) {
  const groups = surface.groups.find((one) => one.name === "material");
  if (!groups) return { index, groups: [], order: null, materialNames: [null] };
  const materialNames = [...groups.labels, null];
  const triangles: number[][] = materialNames.map(() => []);
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
