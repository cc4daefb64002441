// What is drawn of a surface, as it stays at all frames: vertices, triangles, groups, values.

import type { Attribute, Surface } from "../types.js";
import { type Corners, cornersOf } from "./corners.js";
import { type NormalRows, normalRowsOf } from "./normal_rows.js";
import { type Column, type DrawnVertices, splitAtSeams } from "./seams.js";

/** Most sets of texture coordinates that three.js has. */
const MOST_UVS = 4;

/** A stretch of the index with one material. */
export interface Stretch {
  readonly start: number;
  readonly count: number;
  readonly materialIndex: number;
}

/** What is drawn of a surface. */
export interface Drawing extends DrawnVertices {
  /** Triangles of one material follow one another; none where there are no materials. */
  readonly groups: readonly Stretch[];
  /** The triangle of the file that each one is; null where the order is the same. */
  readonly order: Uint32Array | null;
  /** Names of materials, by number in groups; null for faces without one. */
  readonly materialNames: readonly (string | null)[];
  /** Names of the attributes that `uv`, `uv1`, ... are of. */
  readonly uvNames: readonly string[];
  /** What each vertex is split for: its vertex of the file, or its face or corner. */
  readonly items: Uint32Array;
  /** The row of the normal of each vertex: its vertex of the file, where no edge is hard. */
  readonly rows: Uint32Array;
  /** Those of a mesh with hard edges, else null. */
  readonly shading: NormalRows | null;
}

/**
 * What is drawn of a surface of `nVerts` vertices.
 *
 * @param split - Vertices have one face, or corner, each; `items` says which
 */
export function drawingOf(
  surface: Surface,
  nVerts: number,
  split: "face" | "corner" | null = null,
): Drawing {
  const corners = cornersOf(surface);
  const uvs = surface.attributes.filter((one) => one.kind === "uv").slice(0, MOST_UVS);
  const columns = uvs.map(uvColumn);
  const color = surface.attributes.find((one) => one.kind === "color");
  if (color) columns.push(colorColumn(color));
  const nShown = columns.length;
  const shading = normalRowsOf(surface, nVerts);
  if (shading) columns.push(numbered("corner", shading.ofCorner));
  if (split) columns.push(numbersOf(split, surface));
  const { attributes, ...vertices } = splitAtSeams(surface.triangles, nVerts, corners, columns);
  const numbersAt = (place: number) => new Uint32Array(attributes[place].values.buffer);
  return {
    ...vertices,
    attributes: attributes.slice(0, nShown),
    items: split ? numbersAt(attributes.length - 1) : vertices.sources,
    rows: shading ? numbersAt(nShown) : vertices.sources,
    shading,
    ...sortedByMaterial(surface, corners, vertices.index),
    uvNames: uvs.map((uv) => uv.name),
  };
}

/** Faces or corners by their numbers. */
function numbersOf(domain: "face" | "corner", { faceSizes, triangles }: Surface): Column {
  const nTriangles = triangles.length / 3;
  const nFaces = faceSizes?.length ?? nTriangles;
  const count = domain === "face" ? nFaces : nTriangles + 2 * nFaces;
  return numbered(domain, Uint32Array.from({ length: count }, (_, number) => number));
}

/** Numbers, the bits of which pass for values: they are the same where the numbers are. */
function numbered(domain: "face" | "corner", numbers: Uint32Array<ArrayBuffer>): Column {
  return { name: "", domain, width: 1, values: new Float32Array(numbers.buffer) };
}

function uvColumn(attribute: Attribute, number: number): Column {
  const { domain, width, values } = attribute;
  const uv = new Float32Array((values.length / width) * 2);
  for (let i = 0; i < uv.length; i++) {
    uv[i] = i % 2 < width ? values[(i >> 1) * width + (i % 2)] : 0;
  }
  return { name: `uv${number || ""}`, domain, width: 2, values: uv };
}

/** Colours of files are as screens show them; three.js counts in light. Opacity stays. */
function colorColumn({ domain, width, values }: Attribute): Column {
  const out = width === 4 ? 4 : 3;
  const most = values instanceof Uint8Array ? 255 : 1;
  const colors = new Float32Array((values.length / width) * out);
  for (let i = 0; i < colors.length; i++) {
    const channel = i % out;
    const from = Math.floor(i / out) * width + (width < 3 ? 0 : channel);
    const value = Math.min(Math.max(values[from] / most || 0, 0), 1);
    colors[i] = channel === 3 ? value : linear(value);
  }
  return { name: "color", domain, width: out, values: colors };
}

function linear(value: number): number {
  return value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
}

function sortedByMaterial(surface: Surface, corners: Corners, index: Uint32Array) {
  const groups = surface.groups.find((one) => one.name === "material");
  if (!groups) return { index, groups: [], order: null, materialNames: [null] };
  const materialNames = [...groups.labels, null];
  const triangles: number[][] = materialNames.map(() => []);
  const faceOf = corners("face");
  for (let triangle = 0; 3 * triangle < index.length; triangle++) {
    const label = groups.ofFace[faceOf(3 * triangle)];
    (triangles[label] ?? triangles[groups.labels.length]).push(triangle);
  }
  const order = Uint32Array.from(triangles.flat());
  const sorted = index.map((_, i) => index[3 * order[Math.floor(i / 3)] + (i % 3)]);
  let start = 0;
  const stretches = triangles.map(({ length }, materialIndex) => {
    const stretch = { start, count: 3 * length, materialIndex };
    start += stretch.count;
    return stretch;
  });
  return { index: sorted, groups: stretches.filter(({ count }) => count), order, materialNames };
}
