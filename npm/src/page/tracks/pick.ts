// Picks the vertex, face and corner of the file at a position on the mesh.

import type { ReelMesh } from "../../three/reel_mesh.js";
import { Raycaster, Vector3 } from "../../webgl/index.js";

import { type Domain, itemsAtCorners } from "./items.js";

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
  const { surface } = mesh.reel;
  const itemAt = (domain: Domain) => itemsAtCorners(surface, domain)[corner];
  return { vertex: itemAt("vertex"), face: itemAt("face"), corner: itemAt("corner") };
}

/** Return a vertex of a face or corner, or the vertex itself. */
export function vertexOfItem(mesh: ReelMesh, domain: Domain, item: number): number {
  if (domain === "vertex") return item;
  const corner = itemsAtCorners(mesh.reel.surface, domain).indexOf(item);
  if (corner < 0) throw new RangeError(`there is no ${domain} ${item}`);
  return mesh.reel.surface.triangles[corner];
}
