// Materials of faces, and the images that they show.

import { CorruptStreamError } from "../errors.js";
import { ByteReader } from "../stream/byte_reader.js";
import type { Image, Material, MaterialTexture } from "../types.js";
import { misfit } from "./misfit.js";

const CUT_OFF = "a material ends inside its flags";
const ALPHA_MODES = ["opaque", "mask", "blend"] as const;
const DOUBLE_SIDED = 4;
const UNLIT = 8;
const SLOTS = ["baseColor", "metallic", "roughness", "normal", "occlusion", "emissive"] as const;
const SLOTS_OF_COLORS = ["baseColor", "normal", "emissive"];

/** Red, green and blue, and these with alpha; or one of the four. */
const CHANNELS_OF_COLORS = [7, 15];
const CHANNELS_OF_NUMBERS = [1, 2, 4, 8];

const N_WRAPS = 5;
const MAGNIFIERS = 2;
const SHRINKERS = 6;

const MATERIAL_NUMBERS = [1, 1, 1, 1, 1, 1, 0, 0, 0, 1, 1, 0.5];
const TEXTURE_NUMBERS = [0, 0, 0, 1, 1];

/**
 * A material from the payload of its section; the caller checks that its images are there.
 *
 * @throws CorruptStreamError where it is damaged, or bytes are left over.
 */
export function readMaterial(payload: Uint8Array): Material {
  const reader = new ByteReader(payload);
  const name = reader.text();
  const flags = readFlags(reader, 16);
  const numbers = readNumbers(reader, MATERIAL_NUMBERS);
  const slots = readFlags(reader, 1 << SLOTS.length);
  const textures = SLOTS.filter((_, i) => (slots >> i) & 1).map((slot) =>
    readTexture(reader, slot),
  );
  if (reader.left) {
    throw new CorruptStreamError(`${reader.left} bytes follow material '${name}'`);
  }
  return {
    name,
    alphaMode: ALPHA_MODES[choice(flags & 3, ALPHA_MODES.length)],
    doubleSided: (flags & DOUBLE_SIDED) !== 0,
    unlit: (flags & UNLIT) !== 0,
    baseColor: numbers.slice(0, 4) as [number, number, number, number],
    metallic: numbers[4],
    roughness: numbers[5],
    emissive: numbers.slice(6, 9) as [number, number, number],
    normalScale: numbers[9],
    occlusionStrength: numbers[10],
    alphaCutoff: numbers[11],
    textures,
  };
}

/**
 * An image from the payload of its section; its bytes are a copy.
 *
 * @throws CorruptStreamError where it ends inside its name, or this is not UTF-8.
 */
export function readImage(payload: Uint8Array): Image {
  const reader = new ByteReader(payload);
  return { name: reader.text(), mediaType: reader.text(), bytes: reader.rest().slice() };
}

/**
 * Refuses materials that share a name, or show images that are not there.
 *
 * @throws CorruptStreamError where one does.
 */
export function requireFitting(materials: readonly Material[], nImages: number): void {
  const names = new Set<string>();
  for (const { name, textures } of materials) {
    if (names.has(name)) {
      throw misfit(`several materials are called '${name}'; give each a name of its own`);
    }
    names.add(name);
    for (const { slot, image } of textures) {
      if (image >= nImages) {
        throw misfit(
          `the ${slot} texture of material '${name}' shows image ${image}; there are ${nImages}`,
        );
      }
    }
  }
}

function readTexture(reader: ByteReader, slot: MaterialTexture["slot"]): MaterialTexture {
  const image = reader.varint();
  const uv = reader.text();
  const channels = readFlags(reader, 16);
  const wraps = readFlags(reader, 256);
  const filters = readFlags(reader, 256);
  const allowed = SLOTS_OF_COLORS.includes(slot) ? CHANNELS_OF_COLORS : CHANNELS_OF_NUMBERS;
  if (!allowed.includes(channels)) throw misfit(`the ${slot} texture has channels ${channels}`);
  const [wrapU, wrapV] = [choice(wraps & 15, N_WRAPS), choice(wraps >> 4, N_WRAPS)];
  choice(filters & 15, 1 + MAGNIFIERS);
  choice(filters >> 4, 1 + SHRINKERS);
  const [u, v, rotation, scaleU, scaleV] = readNumbers(reader, TEXTURE_NUMBERS);
  return { slot, image, uv, offset: [u, v], rotation, scale: [scaleU, scaleV], wrapU, wrapV };
}

/** Numbers, of which those that are not there have their defaults. */
function readNumbers(reader: ByteReader, defaults: readonly number[]): number[] {
  const present = reader.varint();
  if (present >= 2 ** defaults.length) {
    throw new CorruptStreamError(`a material sets more than its ${defaults.length} numbers`);
  }
  return defaults.map((number, i) => {
    if (!((present >> i) & 1)) return number;
    const found = reader.float64("a material ends inside a number");
    if (!Number.isFinite(found)) throw misfit("a number of a material is not finite");
    return found;
  });
}

function readFlags(reader: ByteReader, limit: number): number {
  const flags = reader.byte(CUT_OFF);
  if (flags >= limit) {
    throw new CorruptStreamError(`a material has flags ${flags}, which are unknown`);
  }
  return flags;
}

/** A number below a limit. */
function choice(code: number, limit: number): number {
  if (code < limit) return code;
  throw new CorruptStreamError(`a material has a choice ${code}, which is unknown`);
}
