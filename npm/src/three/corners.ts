// Maps corners of triangles to the vertices, faces and corners of polygons, and to cells.

import type { Attribute, Surface } from "../types.js";

/** Returns the item of a domain at a corner of a triangle; corner c belongs to triangle floor(c / 3). */
export type ItemLookup = (corner: number) => number;

/** Domains whose items meet at a vertex, so that drawn vertices must be split. */
export type Split = Exclude<Attribute["domain"], "vertex">;

/** Returns the lookup of a domain. */
export type DomainLookup = (domain: Attribute["domain"]) => ItemLookup;

/** Create the lookup of the vertex, face, polygon corner or cell at each corner of a triangle. */
export function createItemLookup(surface: Surface): DomainLookup {
  const { cells, faceSizes, triangleCorners, triangles } = surface;
  return (domain) => {
    if (domain === "vertex") return (corner) => triangles[corner];
    if (domain === "corner") return (corner) => triangleCorners?.[corner] ?? corner;
    const faces: number[] = [];
    faceSizes?.forEach((size, face) => {
      for (let i = 2; i < size; i++) faces.push(face);
    });
    const faceAt: ItemLookup = (corner) => faces[Math.floor(corner / 3)] ?? Math.floor(corner / 3);
    return cells && domain === "cell" ? (corner) => cells.faceCells[faceAt(corner)] : faceAt;
  };
}
