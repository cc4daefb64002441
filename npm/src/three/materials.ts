// Creates three.js materials from those of the file.

import * as THREE from "three";

import type { Image, Material, MaterialTexture, Surface } from "../types.js";
import type { Drawing } from "./drawing.js";
import type { MaterialImages, SendEvent } from "./material_images.js";

type Standard = THREE.MeshStandardMaterial;

/** Color of faces without a material. */
const DEFAULT_COLOR = 0x9eb0c4;

/** The materials of a surface; their images are assigned as they are decoded. */
export class Materials {
  readonly #send: SendEvent;
  /** By `materialIndex` of the drawing. */
  readonly list: (Standard | THREE.MeshBasicMaterial)[];
  #images: MaterialImages | null = null;
  #isDisposed = false;
  /** Materials that the file does not define. */
  readonly #defaults = new Set<THREE.Material>();
  /** Resolves when all images that can be decoded are shown. */
  readonly imagesReady: Promise<unknown>;

  /** @param send - called with "change" when an image is shown, or with "error" */
  constructor(
    surface: Surface,
    drawing: Drawing,
    isFlat: boolean | undefined,
    send: SendEvent,
  ) {
    this.#send = send;
    const hasColors = drawing.attributes.some(({ name }) => name === "color");
    const textureSlots: [THREE.Material, MaterialTexture][] = [];
    this.list = drawing.materialNames.map((name) => {
      const definition = surface.materials.find((one) => one.name === name);
      const material = definition ? createMaterial(definition) : createDefaultMaterial(hasColors);
      if (!definition) this.#defaults.add(material);
      material.vertexColors = hasColors;
      if ("flatShading" in material) material.flatShading = !!isFlat;
      for (const texture of definition?.textures ?? []) textureSlots.push([material, texture]);
      return material;
    });
    this.imagesReady = textureSlots.length
      ? this.#loadImages(textureSlots, surface.images, drawing.uvNames)
      : Promise.resolve();
  }

  /** Whether the file does not define a material. */
  isDefault(material: THREE.Material): boolean {
    return this.#defaults.has(material);
  }

  dispose(): void {
    this.#isDisposed = true;
    this.#images?.dispose();
    for (const material of this.list) material.dispose();
  }

  async #loadImages(
    textureSlots: readonly [THREE.Material, MaterialTexture][],
    ...definition: [images: readonly Image[], uvNames: readonly string[]]
  ): Promise<void> {
    try {
      const { MaterialImages } = await import("./material_images.js");
      if (this.#isDisposed) return;
      const images = (this.#images = new MaterialImages(...definition, this.#send));
      await Promise.all(textureSlots.map(([material, texture]) => images.apply(material, texture)));
    } catch (error) {
      this.#send({ type: "error", error: error as Error, block: null });
    }
  }
}

function createDefaultMaterial(hasColors: boolean): Standard {
  const color = hasColors ? 0xffffff : DEFAULT_COLOR;
  return new THREE.MeshStandardMaterial({ color, roughness: 0.8, side: THREE.DoubleSide });
}

function createMaterial(given: Material): Standard | THREE.MeshBasicMaterial {
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
