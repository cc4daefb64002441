// Maps corners of triangles to the vertices, faces and corners of polygons.

import type { Attribute, Surface } from "../types.js";

/** Returns the item of a domain at a corner of a triangle; corner c belongs to triangle floor(c / 3). */
export type ItemLookup = (corner: number) => number;

/** Returns the lookup of a domain. */
export type DomainLookup = (domain: Attribute["domain"]) => ItemLookup;

/** Create the lookup of the vertex, face or polygon corner at each corner of a triangle. */
export function createItemLookup({ faceSizes, triangles }: Surface): DomainLookup {
  const { faces, corners } = triangulatePolygons(faceSizes ?? [], triangles.length);
  return (domain) => {
    if (domain === "vertex") return (corner) => triangles[corner];
    if (domain === "face") return (corner) => faces[corner] ?? Math.floor(corner / 3);
    return (corner) => corners[corner] ?? corner;
  };
}

/** Split polygons into fans of triangles around their first corners. */
function triangulatePolygons(sizes: ArrayLike<number>, nCorners: number) {
  const faces = new Uint32Array(sizes.length && nCorners);
  const corners = new Uint32Array(faces.length);
  let to = 0;
  let first = 0;
  for (let face = 0; face < sizes.length; face++) {
    for (let second = first + 1; second < first + sizes[face] - 1; second++, to += 3) {
      faces.fill(face, to, to + 3);
      corners.set([first, second, second + 1], to);
    }
    first += sizes[face];
  }
  return { faces, corners };
}
