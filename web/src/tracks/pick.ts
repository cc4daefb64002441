// From a place on the mesh to the vertex, face or corner of the file that lies there.

import type { ReelMesh } from "meshreel/three";
import * as THREE from "three";

import { type Domain, itemsOf } from "./items";

/** What lies at a place. */
export type Picked = Readonly<Record<Domain, number>>;

/** What a ray hits first; null: nothing. */
export function pickedBy(ray: THREE.Raycaster, mesh: ReelMesh): Picked | null {
  const [hit] = ray.intersectObject(mesh, false);
  if (!hit?.face || hit.faceIndex === undefined || hit.faceIndex === null) return null;
  const { a, b, c } = hit.face;
  const point = new THREE.Vector3();
  const away = [a, b, c].map((vertex) => {
    mesh.getVertexPosition(vertex, point);
    return mesh.localToWorld(point).distanceTo(hit.point);
  });
  const at = 3 * hit.faceIndex + away.indexOf(Math.min(...away));
  const { surface } = mesh.reel;
  const itemAt = (domain: Domain) => itemsOf(surface, domain)[at];
  return { vertex: itemAt("vertex"), face: itemAt("face"), corner: itemAt("corner") };
}

/** A vertex of the file that a face or a corner has; of a vertex itself. */
export function vertexOf(mesh: ReelMesh, domain: Domain, item: number): number {
  if (domain === "vertex") return item;
  const at = itemsOf(mesh.reel.surface, domain).indexOf(item);
  if (at < 0) throw new RangeError(`there is no ${domain} ${item}`);
  return mesh.reel.surface.triangles[at];
}
