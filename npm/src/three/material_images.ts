// Images of materials, as the file says how faces look: a script of its own, for most files have none.

import * as THREE from "three";

import { InvalidInputError } from "../errors.js";
import type { Image, MaterialTexture } from "../types.js";

type Slots = Partial<Record<MapSlot, THREE.Texture>>;
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

/** Shows the images of a file on materials, as soon as they are decoded. */
export class MaterialImages {
  readonly #images: readonly Image[];
  readonly #uvNames: readonly string[];
  readonly #onError: (error: Error) => void;
  readonly #textures: THREE.Texture[] = [];
  /** By number of the image; one that several textures show is decoded once. */
  readonly #decoded: Promise<THREE.Texture>[] = [];
  #isOver = false;

  /**
   * @param uvNames - of texture coordinates, by channel
   * @param onError - is told of a texture that cannot be shown
   */
  constructor(
    images: readonly Image[],
    uvNames: readonly string[],
    onError: (error: Error) => void,
  ) {
    this.#images = images;
    this.#uvNames = uvNames;
    this.#onError = onError;
  }

  dispose(): void {
    this.#isOver = true;
    for (const texture of this.#textures) texture.dispose();
    for (const image of this.#decoded) {
      image?.then(
        (texture) => (texture.image as ImageBitmap).close(),
        () => {}, // it was told when it came
      );
    }
  }

  /** Shows an image on a material that has a slot for it, and returns whether it is shown. */
  async dress(material: THREE.Material, given: MaterialTexture): Promise<boolean> {
    const slot = SLOTS[given.slot];
    if (!(slot in material)) return false; // without light only the colour counts
    const image = this.#images[given.image];
    try {
      const shared = await (this.#decoded[given.image] ??= decoded(image));
      if (this.#isOver) return false;
      const channel = this.#uvNames.indexOf(given.uv);
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
      (material as Slots)[slot] = texture;
      material.needsUpdate = true;
      return true;
    } catch (error) {
      if (!this.#isOver) {
        this.#onError(new InvalidInputError(`cannot show ${image.name}: ${error}`));
      }
      return false;
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
