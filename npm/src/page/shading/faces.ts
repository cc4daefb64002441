// The shading of faces: a plain color, a heat map, or the colors of a track.

import { createColorTexture, resolveColorMap } from "../../three/color/color_map.js";
import { DEFAULT_MATERIAL } from "../../three/materials.js";
import { DoubleSide, MeshStandardMaterial } from "../../webgl/index.js";

/** The color map of heat maps, as in `meshreel render`. */
export const HEAT_COLORS = resolveColorMap("sequential");

/** UV set of heat maps; files have fewer. */
const HEAT_CHANNEL = 9;

/** Attribute with the UVs of a heat map. */
export const HEAT_ATTRIBUTE = `uv${HEAT_CHANNEL}`;

/** Moves faces slightly behind the lines drawn over them. */
export const POLYGON_OFFSET = {
  polygonOffset: true,
  polygonOffsetFactor: 1,
  polygonOffsetUnits: 1,
} as const;

/** Shows a plain color, a heat map, or the colors of `ReelMesh.colorBy`. */
export class FaceMaterial extends MeshStandardMaterial {
  constructor() {
    super({ ...DEFAULT_MATERIAL, side: DoubleSide, ...POLYGON_OFFSET });
  }

  /** Show the heat map of `HEAT_ATTRIBUTE`, or a plain color. */
  set hasHeat(hasHeat: boolean) {
    this.map?.dispose();
    this.map = hasHeat ? createColorTexture(HEAT_COLORS) : null;
    if (this.map) this.map.channel = HEAT_CHANNEL;
    this.showsValues = hasHeat;
    this.color.set(hasHeat ? 0xffffff : DEFAULT_MATERIAL.color);
  }

  /** Copy the colors of a track from another material. */
  copyColors({ map, vertexColors, color, showsValues }: FaceMaterial): void {
    Object.assign(this, { map, vertexColors, showsValues });
    this.color.copy(color);
  }
}
