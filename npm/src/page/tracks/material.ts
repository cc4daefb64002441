// The material of meshes that are colored by a track: weakly lit, so that colors match the legend.

import { DoubleSide, MeshBasicMaterial } from "../../webgl/index.js";

import { POLYGON_OFFSET } from "../shading/faces.js";

/** A material for `ReelMesh.colorBy` with slight shading, so that folds remain visible. */
export class TrackMaterial extends MeshBasicMaterial {
  constructor() {
    super({ side: DoubleSide, ...POLYGON_OFFSET });
  }

  /** Copy the color settings of another material. */
  copyColors({ map, vertexColors }: TrackMaterial): void {
    Object.assign(this, { map, vertexColors, needsUpdate: true });
  }

  override readonly glsl = `
    vec3 facing = normalize(cross(dFdx(place), dFdy(place)));
    light *= 0.70 + 0.30 * max(dot(facing, normalize(vec3(-0.45, 0.65, 0.62))), 0.0);`;
}
