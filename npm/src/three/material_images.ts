// Images of materials, as the file says how faces look: a script of its own, for most files have none.

import * as THREE from "three";

import { InvalidInputError } from "../errors.js";
import type { Image, MaterialTexture } from "../types.js";

/** Sends what `ReelMesh` tells of its images. */
export type SendEvent = (
  event: { type: "change" } | { type: "error"; error: Error; block: null },
) => void;

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
  readonly #send: SendEvent;
  readonly #textures: THREE.Texture[] = [];
  /** By number of the image; one that several textures show is decoded once. */
  readonly #decoded: Promise<THREE.Texture>[] = [];
  #isOver = false;

  /**
   * @param uvNames - of texture coordinates, by channel
   * @param send - called with "change" for each image that is shown, else with "error"
   */
  constructor(
    images: readonly Image[],
    uvNames: readonly string[],
    send: SendEvent,
  ) {
    this.#images = images;
    this.#uvNames = uvNames;
    this.#send = send;
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

  /** Shows an image on a material, if that has a slot for it. */
  async dress(material: THREE.Material, given: MaterialTexture): Promise<void> {
    const slot = SLOTS[given.slot];
    if (!(slot in material)) return; // without light only the colour counts
    const image = this.#images[given.image];
    try {
      const shared = await (this.#decoded[given.image] ??= decoded(image));
      if (this.#isOver) return;
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
      this.#send({ type: "change" });
    } catch (thrown) {
      if (this.#isOver) return;
      const error = new InvalidInputError(`cannot show ${image.name}: ${thrown}`);
      this.#send({ type: "error", error, block: null });
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
