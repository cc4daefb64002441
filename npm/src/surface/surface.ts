// What a mesh is beside its positions: polygons, attributes, groups, materials and images.

import type { Core } from "../core/core.js";
import { DEFAULT_MEMORY } from "../decode/memory.js";
import { CorruptStreamError } from "../errors.js";
import { Section } from "../stream/layout.js";
import type { StoredSection } from "../stream/sections.js";
import type { Surface } from "../types.js";
import { readAttribute, withOwnRows } from "./attributes.js";
import { readHardEdges } from "./hard_edges.js";
import { readGroups } from "./groups.js";
import { readImage, readMaterial, requireFitting } from "./materials.js";
import { Polygons, readSizes } from "./polygons.js";

/**
 * The surface of a mesh, from the sections before the first block.
 *
 * @param triangles - As they go out.
 * @param memory - Bytes that decoding may take at once.
 * @throws MemoryLimitError where the table of an attribute is larger than allowed.
 * @throws CorruptStreamError where a section is damaged, or does not fit the mesh.
 */
export function readSurface(
  core: Core,
  leading: readonly StoredSection[],
  triangles: Uint32Array,
  nVerts: number,
  memory = DEFAULT_MEMORY,
): Surface {
  const payloads = (id: number): Uint8Array[] =>
    leading.filter((section) => section.id === id).map((section) => section.payload);
  const polygons = readPolygons(core, payloads(Section.POLYGONS), triangles, nVerts);
  const materials = payloads(Section.MATERIAL).map(readMaterial);
  const images = payloads(Section.IMAGE).map(readImage);
  requireFitting(materials, images.length);
  return {
    triangles,
    faceSizes: polygons.sizes,
    attributes: payloads(Section.ATTRIBUTE).map((payload) =>
      withOwnRows(readAttribute(core, payload, polygons, memory)),
    ),
    groups: payloads(Section.GROUPS).map((payload) => readGroups(core, payload, polygons.nFaces)),
    materials,
    images,
    hardEdges: readOnce(payloads(Section.HARD_EDGES), "HARD_EDGES", (payload) =>
      readHardEdges(core, payload, polygons),
    ),
  };
}

function readPolygons(
  core: Core,
  payloads: readonly Uint8Array[],
  triangles: Uint32Array,
  nVerts: number,
): Polygons {
  const sizes = readOnce(payloads, "POLYGONS", (payload) =>
    readSizes(core, payload, triangles.length / 3),
  );
  return new Polygons(triangles, nVerts, sizes);
}

/** What a section holds that occurs at most once; null without it. */
function readOnce<T>(
  payloads: readonly Uint8Array[],
  name: string,
  read: (payload: Uint8Array) => T,
): T | null {
  if (payloads.length > 1) {
    throw new CorruptStreamError(`the stream has section ${name} more than once`);
  }
  return payloads.length ? read(payloads[0]) : null;
}
