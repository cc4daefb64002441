// Picks the vertex, face, corner and cell of the file at a position on the mesh.

import type { TrackInfo } from "../../index.js";
import { createItemLookup } from "../../three/corners.js";
import type { ReelMesh } from "../../three/reel_mesh.js";
import { Raycaster, Vector3 } from "../../webgl/index.js";

type Domain = TrackInfo["domain"];

/** The items of all domains at a position. */
export type Picked = Readonly<Record<Domain, number>>;

/** Return the items at the first hit of a ray; null without a hit. */
export function pickFirst(ray: Raycaster, mesh: ReelMesh): Picked | null {
  const [hit] = ray.intersectObject(mesh);
  if (!hit?.face || hit.faceIndex === undefined || hit.faceIndex === null) return null;
  const { a, b, c } = hit.face;
  const point = new Vector3();
  const distances = [a, b, c].map((vertex) => {
    mesh.getVertexPosition(vertex, point);
    return mesh.localToWorld(point).distanceTo(hit.point);
  });
  const corner = 3 * hit.faceIndex + distances.indexOf(Math.min(...distances));
  const lookup = createItemLookup(mesh.surface);
  const itemOf = (domain: Domain) => lookup(domain)(corner);
  return { vertex: itemOf("vertex"), face: itemOf("face"), corner: itemOf("corner"), cell: itemOf("cell") };
}

/** Return a vertex of a face, a corner or a cell, or the vertex itself; null for a cell inside. */
export function vertexOfItem(mesh: ReelMesh, domain: Domain, item: number): number | null {
  if (domain === "vertex") return item;
  const { surface } = mesh;
  const itemAt = createItemLookup(surface)(domain);
  return surface.triangles.find((_, corner) => itemAt(corner) === item) ?? null;
}
