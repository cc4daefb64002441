// Reads the surface of a mesh from the structures of the library.

import type { Attribute, Cells, Image, Material, MaterialTexture, Surface } from "../types.js";
import type { File } from "./file.js";
import type { Library } from "./library.js";
import { NUMBER_TYPES, copyNumbers } from "./numbers.js";
import { Struct } from "./struct.js";

const KINDS = ["uv", "color", "other"] as const;
const DOMAINS = ["vertex", "face", "corner", "cell"] as const;
const ALPHA_MODES = ["opaque", "mask", "blend"] as const;
const SLOTS = ["baseColor", "metallic", "roughness", "normal", "occlusion", "emissive"] as const;
const NONE = 2 ** 32 - 1;

/** An image, and the position of its first byte in the file. */
export interface StoredImage extends Image {
  readonly start: number;
}

type StoredSurface = Omit<Surface, "images"> & { readonly images: readonly StoredImage[] };

/** Copy the surface of a file that `meshreel_read_surface` has decoded. */
export function readSurface(library: Library, { handle, info, nPolygons }: File): StoredSurface {
  const { buffer, functions } = library;
  const uint32s = (start: number, length: number): Uint32Array =>
    new Uint32Array(buffer, start, length).slice();
  const fields = new Struct(buffer, functions.meshreel_surface_of(handle) >>> 0);
  const [sizes, corners, ...starts] = fields.uint32s(8);
  const [nAttributes, nGroups, , nMaterials, nImages, nHardEdges] = fields.uint32s(6);
  const [attributes, groups, , materials, images, hardEdges] = starts;
  return {
    triangles: uint32s(functions.meshreel_triangles(handle) >>> 0, 3 * info.nFaces),
    faceSizes: sizes ? uint32s(sizes, nPolygons) : null,
    triangleCorners: corners ? uint32s(corners, 3 * info.nFaces) : null,
    attributes: new Struct(buffer, attributes).array(nAttributes, readAttribute),
    groups: new Struct(buffer, groups).array(nGroups, (group) => {
      const name = group.text();
      const [nLabels, , labels, faceLabels] = group.uint32s(4);
      return {
        name,
        labels: new Struct(buffer, labels).array(nLabels, (label) => label.text()),
        faceLabels: new Int32Array(buffer, faceLabels, nPolygons).slice(),
      };
    }),
    materials: new Struct(buffer, materials).array(nMaterials, readMaterial),
    images: new Struct(buffer, images).array(nImages, (image) => {
      const [name, mediaType] = [image.text(), image.text()];
      return { name, mediaType, start: image.uint64(), sizeBytes: image.uint64() };
    }),
    hardEdges: nHardEdges ? uint32s(hardEdges, 2 * nHardEdges) : null,
    cells: readCells(library, handle, nPolygons),
  };
}

/** Copy the cells of a file that `meshreel_read_surface` has decoded; null if there are none. */
function readCells({ buffer, functions }: Library, handle: number, nPolygons: number): Cells | null {
  const address = functions.meshreel_cells_of(handle) >>> 0;
  if (!address) return null;
  const [nCells, nNodes, types, nodes, faceCells] = new Struct(buffer, address).uint32s(5);
  return {
    types: new Uint8Array(buffer, types, nCells).slice(),
    nodes: new Uint32Array(buffer, nodes, nNodes).slice(),
    faceCells: new Uint32Array(buffer, faceCells, nPolygons).slice(),
  };
}

/** Read an attribute, expanded to one row for each item. */
function readAttribute(fields: Struct): Attribute {
  const name = fields.text();
  const [kind, domain, type, width, nRows, nItems, , , values, rows] = fields.uint32s(10);
  const table = copyNumbers(fields.buffer, type, values, nRows * width) as Float64Array;
  const description = { name, kind: KINDS[kind], domain: DOMAINS[domain], width };
  if (!rows) return { ...description, values: table as Attribute["values"] };
  const [, Numbers] = NUMBER_TYPES[type];
  const expanded = new Numbers(new ArrayBuffer(table.BYTES_PER_ELEMENT * nItems * width));
  new Int32Array(fields.buffer, rows, nItems).forEach((row, i) => {
    for (let k = 0; k < width; k++) expanded[i * width + k] = table[row * width + k];
  });
  return { ...description, values: expanded as Attribute["values"] };
}

function readMaterial(fields: Struct): Material {
  fields.align();
  const name = fields.text();
  const [alphaMode, doubleSided, unlit] = fields.uint32s(4);
  const baseColor = fields.float64s(4) as [number, number, number, number];
  const [metallic, roughness] = fields.float64s(2);
  const emissive = fields.float64s(3) as [number, number, number];
  const [normalScale, occlusionStrength, alphaCutoff] = fields.float64s(3);
  const textures = SLOTS.map((slot) => ({ slot, ...readTexture(fields) }));
  return {
    ...{ name, alphaMode: ALPHA_MODES[alphaMode], doubleSided: doubleSided !== 0 },
    ...{ unlit: unlit !== 0, baseColor, metallic, roughness, emissive },
    ...{ normalScale, occlusionStrength, alphaCutoff },
    textures: textures.filter(({ image }) => image !== NONE),
  };
}

function readTexture(fields: Struct): Omit<MaterialTexture, "slot"> {
  const [image, , wrapU, wrapV] = fields.uint32s(6);
  const uv = fields.text();
  const [u, v, rotation, scaleU, scaleV] = fields.float64s(5);
  return { image, uv, offset: [u, v], rotation, scale: [scaleU, scaleV], wrapU, wrapV };
}
