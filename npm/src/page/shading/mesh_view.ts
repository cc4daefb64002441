// A mesh in a view: its faces and the lines over them.

import { Group, Material, Mesh } from "../../webgl/index.js";

import { POLYGON_OFFSET, FaceMaterial } from "./faces.js";
import { EdgeLines } from "./lines.js";

/** Materials of the file, which need lights. */
export type FileMaterials = Material | Material[];

/** Which materials faces use. */
export type Appearance = "own" | "plain" | "track";

/** A mesh with switchable materials and edge lines. */
export class MeshView {
  readonly group = new Group();
  readonly lines = new EdgeLines();
  readonly faces = new FaceMaterial();
  readonly track = new FaceMaterial();

  constructor(
    private readonly mesh: Mesh,
    private own: FileMaterials,
  ) {
    mesh.frustumCulled = false; // the camera may come arbitrarily close
    this.setFileMaterials(own);
    this.group.add(mesh, this.lines);
  }

  /** Set the materials of the file; call `setAppearance` afterwards. */
  setFileMaterials(own: FileMaterials): void {
    this.own = own;
    for (const material of [own].flat()) Object.assign(material, POLYGON_OFFSET);
  }

  /** Use the materials of the file, the default one, or that of a track. */
  setAppearance(appearance: Appearance, isSmooth: boolean): void {
    this.mesh.material = { own: this.own, plain: this.faces, track: this.track }[appearance];
    for (const material of [this.own, this.faces, this.track].flat()) {
      if (!("flatShading" in material) || material.flatShading === !isSmooth) continue;
      material.flatShading = !isSmooth;
      material.needsUpdate = true;
    }
  }

  /** Share the current position buffer with the lines; call it before drawing. */
  syncPositions(): void {
    const { position } = this.mesh.geometry.attributes;
    const { geometry } = this.lines;
    if (geometry.attributes.position !== position) geometry.setAttribute("position", position);
  }
}
