// Picks the vertex, face and corner of the file at a position on the mesh.

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
  const lookup = createItemLookup(mesh.reel.surface);
  return { vertex: lookup("vertex")(corner), face: lookup("face")(corner), corner: lookup("corner")(corner) };
}

/** Return a vertex of a face or corner, or the vertex itself. */
export function vertexOfItem(mesh: ReelMesh, domain: Domain, item: number): number {
  if (domain === "vertex") return item;
  const { surface } = mesh.reel;
  const itemAt = createItemLookup(surface)(domain);
  const vertex = surface.triangles.find((_, corner) => itemAt(corner) === item);
  if (vertex === undefined) throw new RangeError(`there is no ${domain} ${item}`);
  return vertex;
}
