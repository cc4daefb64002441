// Overrides the maps and colors of materials, and restores them.

import * as THREE from "three";

/** A material with a map. */
export type MappedMaterial = THREE.Material & { map: THREE.Texture | null };

export function hasMap(material: THREE.Material): material is MappedMaterial {
  return "map" in material;
}

/** Set properties of a material, and its color to white; returns a function that restores it. */
export function overrideMaterial(
  material: THREE.Material & { map?: THREE.Texture | null; color?: THREE.Color },
  properties: { readonly map?: THREE.Texture | null; readonly vertexColors?: boolean; readonly showsValues?: boolean },
  isWhite = true,
): () => void {
  const { map, vertexColors } = material;
  const color = material.color?.clone();
  Object.assign(material, properties, { needsUpdate: true });
  if (isWhite) material.color?.set(0xffffff);
  return () => {
    Object.assign(material, { ...("map" in properties && { map }), vertexColors, showsValues: false, needsUpdate: true });
    if (color) material.color?.copy(color);
  };
}
