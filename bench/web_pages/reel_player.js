// Plays a `.reel` with the interface of DracoPlayer, without interpolation between frames.

import * as THREE from "three";
import { ReelFile } from "meshreel";
import { ReelMesh } from "meshreel/three";

export class ReelPlayer {
  nLoops = 0;

  static async open(source, renderer) {
    return new ReelPlayer(await ReelFile.open(source), renderer);
  }

  constructor(reel, renderer) {
    const material = new THREE.MeshBasicMaterial();
    this.mesh = new ReelMesh(reel, { renderer, material, ownsReel: true });
    this.mesh.interpolate = false;
    this.mesh.addEventListener("loop", () => this.nLoops++);
  }

  get frame() {
    return this.mesh.isWaiting ? -1 : this.mesh.frame;
  }

  async first() {
    await new Promise((resolve) => this.mesh.addEventListener("frame", resolve));
    this.mesh.play();
    return this.mesh;
  }

  update(seconds) {
    this.mesh.update(seconds);
  }
}
