// Overrides the maps of materials by a texture, and restores them.

import * as THREE from "three";

import { InvalidInputError } from "../../errors.js";

/** A material with a map. */
type MappedMaterial = THREE.Material & { map: THREE.Texture | null; color?: THREE.Color };

/** The original state of a material. */
interface SavedState {
  readonly material: MappedMaterial;
  readonly map: THREE.Texture | null;
  readonly color: THREE.Color | undefined;
  readonly vertexColors: boolean;
}

/** Shows a texture on all materials that have a map. */
export class MaterialOverride {
  readonly #texture: THREE.Texture;
  #materials: readonly MappedMaterial[];
  #isApplied = false;
  readonly #isDefault: (material: THREE.Material) => boolean;
  #saved: SavedState[] = [];

  /**
   * @param materials - their colors are multiplied with the texture, except for default materials
   * @param isDefault - whether a material is a default one, whose color must not tint the texture
   * @throws InvalidInputError if no material has a map.
   */
  constructor(
    texture: THREE.Texture,
    materials: readonly THREE.Material[],
    isDefault: (material: THREE.Material) => boolean,
  ) {
    this.#texture = texture;
    this.#isDefault = isDefault;
    this.#materials = materials.filter(hasMap);
    if (this.#materials.length) return;
    throw new InvalidInputError(
      "no material of the mesh can show a texture: none has a map; use one such as" +
        " MeshStandardMaterial",
    );
  }

  /** Apply the texture to the materials. */
  apply(): void {
    if (this.#isApplied) return;
    this.#isApplied = true;
    this.#override(this.#materials);
  }

  /** Include further materials. */
  add(materials: readonly THREE.Material[]): void {
    const added = materials.filter(hasMap).filter((one) => !this.#materials.includes(one));
    this.#materials = [...this.#materials, ...added];
    if (this.#isApplied) this.#override(added);
  }

  /** Forget materials, without restoring them. */
  remove(materials: readonly THREE.Material[]): void {
    this.#materials = this.#materials.filter((one) => !materials.includes(one));
    this.#saved = this.#saved.filter(({ material }) => !materials.includes(material));
  }

  #override(materials: readonly MappedMaterial[]): void {
    for (const material of materials) {
      const { map, color, vertexColors } = material;
      this.#saved.push({ material, map, color: color?.clone(), vertexColors });
      material.map = this.#texture;
      if (this.#isDefault(material)) {
        color?.set(0xffffff);
        material.vertexColors = false;
      }
      material.needsUpdate = true;
    }
  }

  /** Restore all materials. */
  dispose(): void {
    for (const { material, map, color, vertexColors } of this.#saved) {
      material.map = map;
      material.vertexColors = vertexColors;
      if (color) material.color?.copy(color);
      material.needsUpdate = true;
    }
    this.#saved = [];
    this.#isApplied = false;
  }
}

function hasMap(material: THREE.Material): material is MappedMaterial {
  return "map" in material;
}
