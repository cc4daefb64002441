// Maps corners of triangles to the vertices, faces and corners of polygons.

import type { Attribute, Surface } from "../types.js";

/** Returns the item of a domain at a corner of a triangle; corner c belongs to triangle floor(c / 3). */
export type ItemLookup = (corner: number) => number;

/** Returns the lookup of a domain. */
export type DomainLookup = (domain: Attribute["domain"]) => ItemLookup;

/** Create the lookup of the vertex, face or polygon corner at each corner of a triangle. */
export function createItemLookup({ faceSizes, triangleCorners, triangles }: Surface): DomainLookup {
  return (domain) => {
    if (domain === "vertex") return (corner) => triangles[corner];
    if (domain === "corner") return (corner) => triangleCorners?.[corner] ?? corner;
    const faces: number[] = [];
    faceSizes?.forEach((size, face) => {
      for (let i = 2; i < size; i++) faces.push(face);
    });
    return (corner) => faces[Math.floor(corner / 3)] ?? Math.floor(corner / 3);
  };
}
