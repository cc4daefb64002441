// The shading of faces: a plain color, a heat map, or the colors of a track.

import { createColorTexture, resolveColorMap } from "../../three/color/color_map.js";
import { DoubleSide, MeshBasicMaterial } from "../../webgl/index.js";

/** The color map of heat maps, as in `meshreel render`. */
export const HEAT_COLORS = resolveColorMap("sequential");

/** UV set of heat maps; files have fewer. */
const HEAT_CHANNEL = 9;

/** Attribute with the UVs of a heat map. */
export const HEAT_ATTRIBUTE = `uv${HEAT_CHANNEL}`;

const PLAIN_COLOR = 0x9eb0c4;

/** Moves faces slightly behind the lines drawn over them. */
export const POLYGON_OFFSET = {
  polygonOffset: true,
  polygonOffsetFactor: 1,
  polygonOffsetUnits: 1,
} as const;

/** Shows a plain color, a heat map, or the colors of `ReelMesh.colorBy`. */
export class FaceMaterial extends MeshBasicMaterial {
  flatShading = false;

  constructor() {
    super({ side: DoubleSide, color: PLAIN_COLOR, ...POLYGON_OFFSET });
  }

  // Faces are lit from both sides, independent of their winding. Colors of values are lit weakly, so that
  // the form is visible, but colors match the legend and folds do not look like errors.
  override readonly glsl = `
    vec3 facing = normalize(cross(dFdx(place), dFdy(place)));
    vec3 n = facing;
#ifndef FLAT
    n = normalize(bent);
    if (dot(n, facing) < 0.0) n = -n;
#endif
    float key = max(dot(n, normalize(vec3(-0.45, 0.65, 0.62))), 0.0);
#if defined(MAP) || defined(COLOR)
    light *= 0.70 + 0.30 * key;
#else
    float fill = max(dot(n, normalize(vec3(0.7, 0.1, 0.7))), 0.0);
    light *= pow(0.37 + 0.52 * key + 0.16 * fill + 0.07 * n.y, 2.2);
#endif`;

  /** Show the heat map of `HEAT_ATTRIBUTE`, or a plain color. */
  set hasHeat(hasHeat: boolean) {
    this.map?.dispose();
    this.map = hasHeat ? createColorTexture(HEAT_COLORS) : null;
    if (this.map) this.map.channel = HEAT_CHANNEL;
    this.color.set(hasHeat ? 0xffffff : PLAIN_COLOR);
  }

  /** Copy the colors of a track from another material. */
  copyColors({ map, vertexColors, color }: FaceMaterial): void {
    Object.assign(this, { map, vertexColors });
    this.color.copy(color);
  }
}
