// Maps corners of triangles to vertices, faces and corners of the file.

import type { Surface } from "../../index.js";

export type Domain = "vertex" | "face" | "corner";

/** Return the vertex, face or corner of the file at each corner of the triangles. */
export function itemsAtCorners(surface: Surface, domain: Domain): Uint32Array {
  const { triangles, faceSizes } = surface;
  if (domain === "vertex") return triangles;
  const nTriangles = triangles.length / 3;
  const items = new Uint32Array(triangles.length);
  let [triangle, firstCorner] = [0, 0];
  for (let face = 0; triangle < nTriangles; face++) {
    const size = faceSizes ? faceSizes[face] : 3;
    for (let i = 1; i < size - 1; i++, triangle++) {
      const corners = [firstCorner, firstCorner + i, firstCorner + i + 1];
      items.set(domain === "face" ? [face, face, face] : corners, 3 * triangle);
    }
    firstCorner += size;
  }
  return items;
}
