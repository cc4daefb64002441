// The surface of a mesh, from the structures of the library.

import type { Attribute, Image, Material, MaterialTexture, Surface } from "../types.js";
import type { File } from "./file.js";
import type { Library } from "./library.js";
import { NUMBER_TYPES, numbersAt } from "./numbers.js";
import { Struct } from "./struct.js";

const KINDS = ["uv", "color", "other"] as const;
const DOMAINS = ["vertex", "face", "corner"] as const;
const ALPHA_MODES = ["opaque", "mask", "blend"] as const;
const SLOTS = ["baseColor", "metallic", "roughness", "normal", "occlusion", "emissive"] as const;
const NONE = 2 ** 32 - 1;

/** The image, and the place of its bytes in the file. */
export interface StoredImage extends Omit<Image, "bytes"> {
  readonly start: number;
  readonly end: number;
}

/** A surface whose images are still in the file. */
export type StoredSurface = Omit<Surface, "images"> & { readonly images: readonly StoredImage[] };

/** The surface of a file, which `meshreel_read_surface` has decoded. */
export function readSurface(library: Library, { handle, info, nPolygons }: File): StoredSurface {
  const { buffer, functions } = library;
  const uint32s = (start: number, length: number): Uint32Array =>
    new Uint32Array(buffer, start, length).slice();
  const found = new Struct(buffer, functions.meshreel_surface_of(handle) >>> 0);
  const [sizes, ...starts] = found.uint32s(7);
  const [nAttributes, nGroups, , nMaterials, nImages, nHardEdges] = found.uint32s(6);
  const [attributes, groups, , materials, images, hardEdges] = starts;
  return {
    triangles: uint32s(functions.meshreel_triangles(handle) >>> 0, 3 * info.nFaces),
    faceSizes: sizes ? uint32s(sizes, nPolygons) : null,
    attributes: new Struct(buffer, attributes).each(nAttributes, readAttribute),
    groups: new Struct(buffer, groups).each(nGroups, (one) => {
      const name = one.text();
      const [nLabels, , labels, ofFaces] = one.uint32s(4);
      return {
        name,
        labels: new Struct(buffer, labels).each(nLabels, (label) => label.text()),
        ofFace: new Int32Array(buffer, ofFaces, nPolygons).slice(),
      };
    }),
    materials: new Struct(buffer, materials).each(nMaterials, readMaterial),
    images: new Struct(buffer, images).each(nImages, (one) => {
      const [name, mediaType, start, size] = [one.text(), one.text(), one.uint64(), one.uint64()];
      return { name, mediaType, start, end: start + size };
    }),
    hardEdges: nHardEdges ? uint32s(hardEdges, 2 * nHardEdges) : null,
  };
}

/** An attribute with one row for each vertex, face or corner. */
function readAttribute(found: Struct): Attribute {
  const name = found.text();
  const [kind, domain, type, width, nRows, nItems, , , values, rows] = found.uint32s(10);
  const table = numbersAt(found.buffer, type, values, nRows * width) as Float64Array;
  const said = { name, kind: KINDS[kind], domain: DOMAINS[domain], width };
  if (!rows) return { ...said, values: table as Attribute["values"] };
  const [, Numbers] = NUMBER_TYPES[type];
  const expanded = new Numbers(new ArrayBuffer(table.BYTES_PER_ELEMENT * nItems * width));
  new Int32Array(found.buffer, rows, nItems).forEach((row, i) => {
    for (let k = 0; k < width; k++) expanded[i * width + k] = table[row * width + k];
  });
  return { ...said, values: expanded as Attribute["values"] };
}

function readMaterial(found: Struct): Material {
  found.align();
  const name = found.text();
  const [alphaMode, doubleSided, unlit] = found.uint32s(4);
  const baseColor = found.float64s(4) as [number, number, number, number];
  const [metallic, roughness] = found.float64s(2);
  const emissive = found.float64s(3) as [number, number, number];
  const [normalScale, occlusionStrength, alphaCutoff] = found.float64s(3);
  const textures = SLOTS.map((slot) => ({ slot, ...readTexture(found) }));
  return {
    ...{ name, alphaMode: ALPHA_MODES[alphaMode], doubleSided: doubleSided !== 0 },
    ...{ unlit: unlit !== 0, baseColor, metallic, roughness, emissive },
    ...{ normalScale, occlusionStrength, alphaCutoff },
    textures: textures.filter(({ image }) => image !== NONE),
  };
}

function readTexture(found: Struct): Omit<MaterialTexture, "slot"> {
  const [image, , wrapU, wrapV] = found.uint32s(6);
  const uv = found.text();
  const [u, v, rotation, scaleU, scaleV] = found.float64s(5);
  return { image, uv, offset: [u, v], rotation, scale: [scaleU, scaleV], wrapU, wrapV };
}
