// Corners of the triangles of a mesh, as vertices, faces and corners of its polygons.

import type { Attribute, Surface } from "../types";

/** For each corner of each triangle, which item of a domain it is. */
export type ItemOf = (corner: number) => number;

/** Which vertex, face or corner of a polygon each corner of a triangle is. */
export class Corners {
  readonly #surface: Surface;
  readonly #faceOf: Uint32Array | null;
  readonly #cornerOf: Uint32Array | null;

  constructor(surface: Surface) {
    this.#surface = surface;
    const { faceSizes, triangles } = surface;
    this.#faceOf = faceSizes && new Uint32Array(triangles.length / 3);
    this.#cornerOf = faceSizes && new Uint32Array(triangles.length);
    if (faceSizes && this.#faceOf && this.#cornerOf) {
      fillFans(faceSizes, this.#faceOf, this.#cornerOf);
    }
  }

  /** The polygon of a triangle. */
  polygonOf(triangle: number): number {
    return this.#faceOf ? this.#faceOf[triangle] : triangle;
  }

  /** Which item of the domain a corner of a triangle is. */
  items(domain: Attribute["domain"]): ItemOf {
    const cornerOf = this.#cornerOf;
    if (domain === "vertex") return (corner) => this.#surface.triangles[corner];
    if (domain === "face") return (corner) => this.polygonOf(Math.floor(corner / 3));
    return (corner) => (cornerOf ? cornerOf[corner] : corner);
  }
}

/** A polygon is a fan of triangles from its first corner. */
function fillFans(sizes: Uint32Array, faceOf: Uint32Array, cornerOf: Uint32Array): void {
  let triangle = 0;
  let first = 0;
  sizes.forEach((size, face) => {
    for (let second = 1; second < size - 1; second++, triangle++) {
      faceOf[triangle] = face;
      cornerOf.set([first, first + second, first + second + 1], 3 * triangle);
    }
    first += size;
  });
}
