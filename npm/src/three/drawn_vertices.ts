// Vertices to draw: those of the file, split where values of corners or faces differ, with their
// attributes.

import type { Attribute, Surface } from "../types.js";
import { createItemLookup, type Split } from "./corners.js";
import { createNormalRows, type NormalRows } from "./normal_rows.js";
import { splitVertices } from "./split_vertices.js";

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

/** An attribute with a value per item of a domain. */
interface DomainAttribute extends VertexAttribute {
  readonly domain: Attribute["domain"];
}

/**
 * Create the drawn vertices of a surface with `nVerts` vertices.
 *
 * @param uvs - the UV attributes to draw
 * @param split - as for `createDrawing`
 */
export function createDrawnVertices(
  surface: Surface,
  nVerts: number,
  uvs: readonly Attribute[],
  split: Split | null,
): DrawnVertices {
  const { triangles } = surface;
  const lookup = createItemLookup(surface);
  const colors = surface.attributes.filter(({ kind }) => kind === "color").slice(0, 1);
  const columns = [...uvs.map(uvColumn), ...colors.map(colorColumn)];
  const normalRows = createNormalRows(surface, nVerts, lookup("corner"));
  const { cornerRows } = normalRows;
  if (!split && cornerRows === triangles && columns.every(({ domain }) => domain === "vertex")) {
    const sources = Uint32Array.from({ length: nVerts }, (_, vertex) => vertex);
    return { ...normalRows, index: triangles, sources, items: sources, rows: sources, attributes: columns };
  }
  // A normal row has one vertex, so that vertices and their attributes need not be compared.
  const cornerItems = split ? triangles.map((_, corner) => lookup(split)(corner)) : triangles;
  const atCorners = (split ? [cornerRows, cornerItems] : [cornerRows]).map((values) => {
    return { width: 1, values, itemOf: (corner: number) => corner };
  });
  const atItems = columns.map((column) => ({ ...column, itemOf: lookup(column.domain) }));
  const keys = [...atCorners, ...atItems.filter(({ domain }) => domain !== "vertex")];
  const { index, firstCorners } = splitVertices(keys, triangles.length);
  const gather = (values: Uint32Array) => firstCorners.map((corner) => values[corner]);
  const attributes = atItems.map(({ name, values, width, itemOf }) => {
    const drawn = new Float32Array(firstCorners.length * width);
    firstCorners.forEach((corner, i) => {
      const from = width * itemOf(corner);
      drawn.set(values.subarray(from, from + width), width * i);
    });
    return { name, width, values: drawn };
  });
  return {
    ...normalRows,
    index,
    sources: gather(triangles),
    items: gather(cornerItems),
    rows: gather(cornerRows),
    attributes,
  };
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
  const maxValue = values instanceof Uint8Array || values instanceof Int32Array ? 255 : 1;
  const colors = new Float32Array((values.length / width) * channels);
  for (let i = 0; i < colors.length; i++) {
    const channel = i % channels;
    const from = Math.floor(i / channels) * width + (width < 3 ? 0 : channel);
    const value = Math.min(Math.max(values[from] / maxValue || 0, 0), 1);
    colors[i] = channel === 3 ? value : srgbToLinear(value);
  }
  return { name: "color", domain, width: channels, values: colors };
}

/** Convert a number from sRGB to linear, 0..1. */
export function srgbToLinear(value: number): number {
  return value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
}
