// A texture over the materials of a mesh, and what was there before.

import * as THREE from "three";

import { InvalidInputError } from "../../errors.js";

/** A material that shows a texture. */
type Dressed = THREE.Material & { map: THREE.Texture | null; color?: THREE.Color };

/** How a material was. */
interface Before {
  readonly material: Dressed;
  readonly map: THREE.Texture | null;
  readonly color: THREE.Color | undefined;
  readonly vertexColors: boolean;
}

/** Shows one texture on all materials of a mesh that can, until it is taken away. */
export class Cover {
  readonly #texture: THREE.Texture;
  readonly #materials: readonly Dressed[];
  readonly #isPlain: (material: THREE.Material) => boolean;
  #before: Before[] = [];

  /**
   * @param materials - whose colours stay, and are multiplied with the texture
   * @param isPlain - says of a material whose colours are ours, and must not tint the texture
   * @throws InvalidInputError where no material can show a texture.
   */
  constructor(
    texture: THREE.Texture,
    materials: readonly THREE.Material[],
    isPlain: (material: THREE.Material) => boolean,
  ) {
    this.#texture = texture;
    this.#isPlain = isPlain;
    this.#materials = materials.filter(isDressed);
    if (this.#materials.length) return;
    throw new InvalidInputError(
      "no material of the mesh can show a texture: none has a map; use one such as" +
        " MeshStandardMaterial",
    );
  }

  /** Puts it over the materials. */
  put(): void {
    if (this.#before.length) return;
    for (const material of this.#materials) {
      const { map, color, vertexColors } = material;
      this.#before.push({ material, map, color: color?.clone(), vertexColors });
      material.map = this.#texture;
      if (this.#isPlain(material)) {
        color?.set(0xffffff);
        material.vertexColors = false;
      }
      material.needsUpdate = true;
    }
  }

  /** Gives the materials back what they had. */
  remove(): void {
    for (const { material, map, color, vertexColors } of this.#before) {
      material.map = map;
      material.vertexColors = vertexColors;
      if (color) material.color?.copy(color);
      material.needsUpdate = true;
    }
    this.#before = [];
  }
}

function isDressed(material: THREE.Material): material is Dressed {
  return "map" in material;
}
