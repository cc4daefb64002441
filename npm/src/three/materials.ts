// Materials of three.js as the file says how faces look.

import * as THREE from "three";

import { InvalidInputError } from "../errors.js";
import type { Image, Material, MaterialTexture, Surface } from "../types.js";
import type { Drawing } from "./drawing.js";

type Standard = THREE.MeshStandardMaterial;
type MapSlot = "map" | "metalnessMap" | "roughnessMap" | "normalMap" | "aoMap" | "emissiveMap";

const SLOTS: Record<MaterialTexture["slot"], MapSlot> = {
  baseColor: "map",
  metallic: "metalnessMap",
  roughness: "roughnessMap",
  normal: "normalMap",
  occlusion: "aoMap",
  emissive: "emissiveMap",
};

/** By number of a way to wrap: three.js has no black outside. */
const WRAPS = [
  THREE.RepeatWrapping,
  THREE.MirroredRepeatWrapping,
  THREE.ClampToEdgeWrapping,
  THREE.ClampToEdgeWrapping,
  THREE.RepeatWrapping,
] as const;

/** Colour of faces about which the file says nothing. */
const PLAIN = 0x9eb0c4;

/** The materials of a surface; their images appear as they are decoded. */
export class Materials {
  readonly #surface: Surface;
  readonly #drawing: Drawing;
  readonly #onError: (error: Error) => void;
  /** By number in the groups of the drawing. */
  readonly list: (Standard | THREE.MeshBasicMaterial)[];
  readonly #textures: THREE.Texture[] = [];
  /** By number of the image; one that several textures show is decoded once. */
  readonly #images: Promise<THREE.Texture>[] = [];
  #isOver = false;
  /** Those of faces about which the file says nothing. */
  readonly #plain = new Set<THREE.Material>();
  /** When all images that can be shown are. */
  readonly dressed: Promise<unknown>;

  /** @param onError - is told of a texture that cannot be shown */
  constructor(
    surface: Surface,
    drawing: Drawing,
    isFlat: boolean | undefined,
    onError: (error: Error) => void,
  ) {
    this.#surface = surface;
    this.#drawing = drawing;
    this.#onError = onError;
    const hasColors = drawing.attributes.some(({ name }) => name === "color");
    const dressing: Promise<void>[] = [];
    this.list = drawing.materialNames.map((name) => {
      const given = surface.materials.find((one) => one.name === name);
      const made = given ? materialOf(given) : plainMaterial(hasColors);
      if (!given) this.#plain.add(made);
      made.vertexColors = hasColors;
      if ("flatShading" in made) made.flatShading = !!isFlat;
      for (const texture of given?.textures ?? []) dressing.push(this.#dress(made, texture));
      return made;
    });
    this.dressed = Promise.all(dressing);
  }

  /** Whether the file says nothing of how it looks. */
  isPlain(material: THREE.Material): boolean {
    return this.#plain.has(material);
  }

  dispose(): void {
    this.#isOver = true;
    for (const one of [...this.list, ...this.#textures]) one.dispose();
    for (const image of this.#images) {
      image?.then(
        (texture) => (texture.image as ImageBitmap).close(),
        () => {}, // it was told when it came
      );
    }
  }

  async #dress(material: THREE.Material, given: MaterialTexture): Promise<void> {
    const slot = SLOTS[given.slot];
    if (!(slot in material)) return; // without light only the colour counts
    const image = this.#surface.images[given.image];
    try {
      const shared = await (this.#images[given.image] ??= decoded(image));
      if (this.#isOver) return;
      const channel = this.#drawing.uvNames.indexOf(given.uv);
      if (channel < 0) throw new Error(`there are no texture coordinates ${given.uv}`);
      const texture = shared.clone();
      texture.channel = channel;
      texture.wrapS = WRAPS[given.wrapU];
      texture.wrapT = WRAPS[given.wrapV];
      texture.matrixAutoUpdate = false;
      texture.matrix.copy(transformOf(given));
      if (slot === "map" || slot === "emissiveMap") texture.colorSpace = THREE.SRGBColorSpace;
      texture.needsUpdate = true;
      this.#textures.push(texture);
      (material as Standard)[slot] = texture;
      material.needsUpdate = true;
    } catch (error) {
      if (this.#isOver) return;
      this.#onError(new InvalidInputError(`cannot show ${image.name}: ${error}`));
    }
  }
}

/** With v upwards, as texture coordinates are, and numbers as they are in the file. */
async function decoded({ bytes, mediaType }: Image): Promise<THREE.Texture> {
  const blob = new Blob([bytes as Uint8Array<ArrayBuffer>], { type: mediaType });
  const bitmap = await createImageBitmap(blob, {
    imageOrientation: "flipY",
    premultiplyAlpha: "none",
    colorSpaceConversion: "none",
  });
  const texture = new THREE.Texture(bitmap);
  texture.flipY = false;
  return texture;
}

/** Of texture coordinates with v upwards; the file says it with v downwards, as glTF does. */
function transformOf({ offset, rotation, scale }: MaterialTexture): THREE.Matrix3 {
  const [c, s] = [Math.cos(rotation), Math.sin(rotation)];
  const [x, y] = scale;
  const [u, v] = offset;
  return new THREE.Matrix3(c * x, -s * y, u + s * y, s * x, c * y, 1 - v - c * y, 0, 0, 1);
}

function plainMaterial(hasColors: boolean): Standard {
  const color = hasColors ? 0xffffff : PLAIN;
  return new THREE.MeshStandardMaterial({ color, roughness: 0.8, side: THREE.DoubleSide });
}

function materialOf(given: Material): Standard | THREE.MeshBasicMaterial {
  const [red, green, blue, opacity] = given.baseColor;
  const isBlend = given.alphaMode === "blend";
  const common = {
    name: given.name,
    color: new THREE.Color(red, green, blue),
    opacity: given.alphaMode === "opaque" ? 1 : opacity,
    transparent: isBlend,
    depthWrite: !isBlend,
    alphaTest: given.alphaMode === "mask" ? given.alphaCutoff : 0,
    side: given.doubleSided ? THREE.DoubleSide : THREE.FrontSide,
  };
  if (given.unlit) return new THREE.MeshBasicMaterial(common);
  return new THREE.MeshStandardMaterial({
    ...common,
    metalness: given.metallic,
    roughness: given.roughness,
    emissive: new THREE.Color(...given.emissive),
    normalScale: new THREE.Vector2(given.normalScale, given.normalScale),
    aoMapIntensity: given.occlusionStrength,
  });
}
