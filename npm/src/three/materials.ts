// Materials of three.js as the file says how faces look.

import * as THREE from "three";

import type { Image, Material, MaterialTexture, Surface } from "../types.js";
import type { Drawing } from "./drawing.js";
import type { MaterialImages, SendEvent } from "./material_images.js";

type Standard = THREE.MeshStandardMaterial;

/** Colour of faces about which the file says nothing. */
const PLAIN = 0x9eb0c4;

/** The materials of a surface; their images appear as they are decoded. */
export class Materials {
  readonly #send: SendEvent;
  /** By number in the groups of the drawing. */
  readonly list: (Standard | THREE.MeshBasicMaterial)[];
  #images: MaterialImages | null = null;
  #isOver = false;
  /** Those of faces about which the file says nothing. */
  readonly #plain = new Set<THREE.Material>();
  /** When all images that can be shown are. */
  readonly dressed: Promise<unknown>;

  /** @param send - called with "change" for each image that is shown, else with "error" */
  constructor(
    surface: Surface,
    drawing: Drawing,
    isFlat: boolean | undefined,
    send: SendEvent,
  ) {
    this.#send = send;
    const hasColors = drawing.attributes.some(({ name }) => name === "color");
    const worn: [THREE.Material, MaterialTexture][] = [];
    this.list = drawing.materialNames.map((name) => {
      const given = surface.materials.find((one) => one.name === name);
      const made = given ? materialOf(given) : plainMaterial(hasColors);
      if (!given) this.#plain.add(made);
      made.vertexColors = hasColors;
      if ("flatShading" in made) made.flatShading = !!isFlat;
      for (const texture of given?.textures ?? []) worn.push([made, texture]);
      return made;
    });
    this.dressed = worn.length ? this.#dress(worn, surface.images, drawing.uvNames) : Promise.resolve();
  }

  /** Whether the file says nothing of how it looks. */
  isPlain(material: THREE.Material): boolean {
    return this.#plain.has(material);
  }

  dispose(): void {
    this.#isOver = true;
    this.#images?.dispose();
    for (const material of this.list) material.dispose();
  }

  async #dress(
    worn: readonly [THREE.Material, MaterialTexture][],
    ...given: [images: readonly Image[], uvNames: readonly string[]]
  ): Promise<void> {
    try {
      const { MaterialImages } = await import("./material_images.js");
      if (this.#isOver) return;
      const images = (this.#images = new MaterialImages(...given, this.#send));
      await Promise.all(worn.map(([material, texture]) => images.dress(material, texture)));
    } catch (error) {
      this.#send({ type: "error", error: error as Error, block: null });
    }
  }
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
