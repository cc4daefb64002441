// Plays one Draco file per frame, like UVOL's players: prefetches four seconds of files, decodes
// them in three.js's workers to geometries, and disposes of each after it was shown.

import * as THREE from "three";
import { DRACOLoader } from "three/examples/jsm/loaders/DRACOLoader.js";

const AHEAD_S = 4;

export class DracoPlayer {
  frame = -1;
  nLoops = 0;
  #place = 0;
  #asked = new Map();
  #ready = new Map();

  /**
   * @param address - returns the address of a frame's file, or its bytes
   * @param loader - with its decoder loaded
   */
  constructor(address, nFrames, fps, loader) {
    Object.assign(this, { address, nFrames, fps, loader });
    this.mesh = new THREE.Mesh(new THREE.BufferGeometry(), new THREE.MeshBasicMaterial());
    this.#ask();
  }

  /** Creates a loader; decodes `bytes`, if given, to compile the decoder in a worker. */
  static async loader(bytes) {
    const loader = new DRACOLoader().setDecoderPath("/draco/").preload();
    if (bytes) (await decoded(loader, bytes)).dispose();
    return loader;
  }

  get isWaiting() {
    return !this.#ready.has(Math.floor(this.#place) % this.nFrames) && this.#now !== this.frame;
  }

  get #now() {
    return Math.floor(this.#place);
  }

  async first() {
    await this.#asked.get(0);
    this.#show();
    return this.mesh;
  }

  update(seconds) {
    if (!this.isWaiting) this.#place += seconds * this.fps;
    if (this.#place >= this.nFrames) {
      this.#place %= this.nFrames;
      this.nLoops++;
    }
    this.#ask();
    this.#show();
  }

  #show() {
    const geometry = this.#ready.get(this.#now);
    if (!geometry || this.#now === this.frame) return;
    this.mesh.geometry.dispose();
    this.mesh.geometry = geometry;
    this.frame = this.#now;
    for (const [number, passed] of this.#ready) {
      if ((number - this.frame + this.nFrames) % this.nFrames < AHEAD_S * this.fps) continue;
      passed.dispose();
      this.#ready.delete(number);
      this.#asked.delete(number);
    }
    this.#ready.delete(this.frame);
    this.#asked.delete(this.frame);
  }

  #ask() {
    const most = Math.min(AHEAD_S * this.fps, this.nFrames);
    for (let ahead = 0; ahead < most; ahead++) {
      const number = (this.#now + ahead) % this.nFrames;
      if (number === this.frame || this.#asked.has(number)) continue;
      this.#asked.set(number, this.#load(number));
    }
  }

  async #load(number) {
    const from = this.address(number);
    // Bytes in memory are copied, because workers take ownership of their input.
    const bytes = from instanceof ArrayBuffer ? from.slice() : await (await fetch(from)).arrayBuffer();
    this.#ready.set(number, await decoded(this.loader, bytes));
  }
}

function decoded(loader, bytes) {
  return new Promise((resolve, reject) => loader.parse(bytes, resolve, reject));
}
