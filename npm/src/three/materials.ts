// Creates three.js materials from those of the file.

import * as THREE from "three";

import type { Material, OpenReel } from "../types.js";
import type { Drawing } from "./drawing.js";
import { applyImages, type SendEvent } from "./material_images.js";

type Standard = THREE.MeshStandardMaterial;

/** Faces without a material, as in meshreel/model/materials.py. */
export const DEFAULT_MATERIAL = { color: 0xb4b4b4, roughness: 0.4 };

/** The materials of a surface; `loadImages` adds their images. */
export class Materials {
  /** By `materialIndex` of the drawing. */
  readonly list: (Standard | THREE.MeshBasicMaterial)[];
  readonly #startImages: () => Promise<void>;
  #imagesReady: Promise<void> | null = null;
  /** Aborted by `dispose`. */
  readonly #lifetime = new AbortController();

  /** @param send - called with "change" when an image is shown, or with "error" */
  constructor(reel: OpenReel, drawing: Drawing, isFlat: boolean, send: SendEvent) {
    const { surface } = reel;
    const hasColors = surface.attributes.some(({ kind }) => kind === "color");
    const definitions = drawing.materialNames.map((name) => surface.materials.find((material) => material.name === name));
    this.list = definitions.map((definition) => {
      const material = definition ? createMaterial(definition) : createDefaultMaterial(hasColors);
      material.vertexColors = hasColors;
      if ("flatShading" in material) material.flatShading = isFlat;
      return material;
    });
    const { signal } = this.#lifetime;
    this.#startImages = () => applyImages(this.list, definitions, reel, drawing.uvNames, send, signal);
  }

  /** Load the images, once; resolves when all that can be decoded are shown. */
  loadImages(): Promise<void> {
    return (this.#imagesReady ??= this.#startImages());
  }

  dispose(): void {
    this.#lifetime.abort();
    for (const material of this.list) material.dispose();
  }
}

function createDefaultMaterial(hasColors: boolean): Standard {
  const color = hasColors ? 0xffffff : DEFAULT_MATERIAL.color;
  return new THREE.MeshStandardMaterial({ ...DEFAULT_MATERIAL, color, side: THREE.DoubleSide });
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
