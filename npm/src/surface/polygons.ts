// Polygons of a mesh, which are cut into triangles as fans from their first corners.

import type { Core } from "../core/core.js";
import { CorruptStreamError } from "../errors.js";
import { decodeIntegers } from "../decode/integers.js";
import { ByteReader } from "../stream/byte_reader.js";
import { misfit } from "./misfit.js";

/** What values of attributes are of. */
export type Domain = "vertex" | "face" | "corner";

/** The faces of a mesh; corners of faces are counted through, face after face. */
export class Polygons {
  /** @param sizes - Corners of each face, or null where all are triangles. */
  constructor(
    readonly triangles: Uint32Array,
    readonly nVerts: number,
    readonly sizes: Uint32Array | null,
  ) {}

  get nTriangles(): number {
    return this.triangles.length / 3;
  }

  get nFaces(): number {
    return this.sizes?.length ?? this.nTriangles;
  }

  /** Number of vertices, faces or corners of faces. */
  count(domain: Domain): number {
    const nCorners = this.nTriangles + 2 * this.nFaces; // a face has two more than triangles
    return { vertex: this.nVerts, face: this.nFaces, corner: nCorners }[domain];
  }

  /** The corner of a face at each corner of a triangle. */
  cornersOfTriangles(): Int32Array {
    const found = new Int32Array(this.triangles.length);
    if (!this.sizes) return found.map((_, i) => i);
    let place = 0;
    let first = 0;
    for (const size of this.sizes) {
      for (let k = 1; k < size - 1; k++) {
        found[place++] = first;
        found[place++] = first + k;
        found[place++] = first + k + 1;
      }
      first += size;
    }
    return found;
  }

  /** The face at each corner of a triangle. */
  facesOfTriangles(): Int32Array {
    const found = new Int32Array(this.triangles.length);
    if (!this.sizes) return found.map((_, i) => Math.floor(i / 3));
    let place = 0;
    this.sizes.forEach((size, face) => {
      found.fill(face, place, place + 3 * (size - 2));
      place += 3 * (size - 2);
    });
    return found;
  }

  /** The vertex of each corner: that of the first triangle that has it. */
  verticesOfCorners(): Uint32Array {
    if (!this.sizes) return this.triangles;
    const found = new Uint32Array(this.count("corner"));
    const corners = this.cornersOfTriangles();
    for (let i = corners.length - 1; i >= 0; i--) found[corners[i]] = this.triangles[i];
    return found;
  }
}

/**
 * Corners of each face, from the payload of POLYGONS; null where all are triangles.
 *
 * @throws CorruptStreamError where they do not make so many triangles.
 */
export function readSizes(core: Core, payload: Uint8Array, nTriangles: number): Uint32Array | null {
  const reader = new ByteReader(payload);
  const nFaces = reader.varint();
  if (nFaces > nTriangles) {
    throw new CorruptStreamError(`${nFaces} polygons are announced for ${nTriangles} triangles`);
  }
  const [above] = decodeIntegers(core, reader.rest(), [nFaces]);
  if (above.some((size) => size < 0 || size > nTriangles)) {
    throw new CorruptStreamError("a polygon has fewer than 3 corners, or too many");
  }
  const total = above.reduce((sum, size) => sum + size + 1, 0);
  if (total !== nTriangles) {
    throw misfit(`face_sizes make ${total} triangles as fans; the mesh has ${nTriangles}`);
  }
  return above.some((size) => size) ? Uint32Array.from(above, (size) => size + 3) : null;
}
