// A mesh as it is drawn: faces in one look or another, and lines over them.

import * as THREE from "three";

import { BEHIND_LINES, FaceMaterial } from "./faces";
import { EdgeLines } from "./lines";

/** Materials of the file, which want light. */
export type OwnMaterials = THREE.Material | THREE.Material[];

export class Figure {
  readonly group = new THREE.Group();
  readonly lines = new EdgeLines();
  readonly faces = new FaceMaterial();

  constructor(
    private readonly mesh: THREE.Mesh,
    private readonly own: OwnMaterials,
  ) {
    mesh.frustumCulled = false; // the camera comes as near as it likes
    for (const material of [own].flat()) Object.assign(material, BEHIND_LINES);
    this.group.add(mesh, this.lines);
  }

  /** Shows its own materials, or the player's. */
  dress(isOwn: boolean, isSmooth: boolean): void {
    this.mesh.material = isOwn ? this.own : this.faces;
    this.faces.isSmooth = isSmooth;
    for (const material of [this.own].flat()) {
      if (!("flatShading" in material) || material.flatShading === !isSmooth) continue;
      material.flatShading = !isSmooth;
      material.needsUpdate = true;
    }
  }

  /** To be called before it is drawn: positions may lie elsewhere now. */
  join(): void {
    const { position } = this.mesh.geometry.attributes;
    const { geometry } = this.lines;
    if (geometry.attributes.position !== position) geometry.setAttribute("position", position);
  }
}
