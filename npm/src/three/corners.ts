// Corners of the triangles of a mesh, as vertices, faces and corners of its polygons.

import type { Attribute, Surface } from "../types.js";

/** Which item of a domain a corner of a triangle is; corners are counted through. */
export type ItemOf = (corner: number) => number;

/** For each domain, which of its items corners are. */
export type Corners = (domain: Attribute["domain"]) => ItemOf;

/** Which vertex, face or corner of a polygon each corner of a triangle is. */
export function cornersOf({ faceSizes, triangles }: Surface): Corners {
  const { faces, corners } = fansOf(faceSizes ?? [], triangles.length);
  return (domain) => {
    if (domain === "vertex") return (corner) => triangles[corner];
    if (domain === "face") return (corner) => faces[corner] ?? Math.floor(corner / 3);
    return (corner) => corners[corner] ?? corner;
  };
}

/** Polygons are fans of triangles from their first corners. */
function fansOf(sizes: ArrayLike<number>, nCorners: number) {
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
