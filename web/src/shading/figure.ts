// A mesh as it is drawn: faces in one look or another, and lines over them.

import * as THREE from "three";

import { BEHIND_LINES, FaceMaterial } from "./faces";
import { EdgeLines } from "./lines";
import { TrackMaterial } from "../tracks/material";

/** Materials of the file, which want light. */
export type OwnMaterials = THREE.Material | THREE.Material[];

/** What faces wear. */
export type Worn = "own" | "plain" | "track";

export class Figure {
  readonly group = new THREE.Group();
  readonly lines = new EdgeLines();
  readonly faces = new FaceMaterial();
  readonly track = new TrackMaterial();

  constructor(
    private readonly mesh: THREE.Mesh,
    private readonly own: OwnMaterials,
  ) {
    mesh.frustumCulled = false; // the camera comes as near as it likes
    for (const material of [own].flat()) Object.assign(material, BEHIND_LINES);
    this.group.add(mesh, this.lines);
  }

  /** Shows its own materials, the player's, or that of a track. */
  dress(worn: Worn, isSmooth: boolean): void {
    this.mesh.material = { own: this.own, plain: this.faces, track: this.track }[worn];
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
