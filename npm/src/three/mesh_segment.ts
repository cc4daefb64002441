// A segment of a file as three.js draws it: its geometry, materials and backend.

import * as THREE from "three";

import type { BlockInfo, OpenReel, OpenSegments } from "../types.js";
import type { Backend, MeshSetup } from "./backend.js";
import { type Drawing, createDrawing } from "./drawing.js";
import type { SendEvent } from "./material_images.js";
import { Materials } from "./materials.js";

/** Assumed error of positions, in percent of the diagonal, if the file guarantees no bound. */
const DEFAULT_ERROR_PERCENT = 10;

/** A segment in memory. Its geometry draws nothing until there is a picture. */
export class MeshSegment {
  setup: MeshSetup;
  geometry!: THREE.BufferGeometry;
  /** Null if the page provides the material. */
  readonly materials: Materials | null;
  backend: Backend | null = null;
  /** Domain by which the vertices of the geometry are split. */
  #split: "face" | "corner" | null = null;

  /**
   * @param number - index of the segment
   * @param hasMaterials - whether to create the materials of the file
   * @param send - as for `Materials`
   */
  constructor(
    readonly number: number,
    readonly reel: OpenReel,
    origin: readonly [number, number, number],
    hasMaterials: boolean,
    isFlat: boolean | undefined,
    send: SendEvent,
  ) {
    const { info, surface } = reel;
    const drawing = createDrawing(surface, info.nVerts);
    const [x, y, z] = info.center;
    const shift = [x - origin[0], y - origin[1], z - origin[2]] as const;
    this.setup = { info, triangles: surface.triangles, drawing, shift };
    this.#createGeometry();
    this.materials = hasMaterials ? new Materials(surface, drawing, isFlat, send) : null;
  }

  /** The materials of the file as `THREE.Mesh` expects them. */
  get material(): THREE.Material | THREE.Material[] | undefined {
    const list = this.materials?.list;
    return this.setup.drawing.groups.length ? list : list?.[0];
  }

  /** Prepare the geometry for a new backend and for a split; returns whether it was replaced. */
  rebuildGeometry(split: "face" | "corner" | null): boolean {
    this.geometry.dispose(); // also frees the buffers of attributes that will be replaced
    if (split === this.#split) return false;
    this.#split = split;
    const { surface, info } = this.reel;
    this.setup = { ...this.setup, drawing: createDrawing(surface, info.nVerts, split) };
    this.#createGeometry();
    return true;
  }

  /** The domain by which vertices are split. */
  get split(): "face" | "corner" | null {
    return this.#split;
  }

  dispose(): void {
    this.backend?.dispose();
    this.geometry.dispose();
    this.materials?.dispose();
  }

  /** Create the geometry; its bounds contain all frames, including the coding error. */
  #createGeometry(): void {
    const { info, shift, drawing } = this.setup;
    const radius = info.diagonal * (0.5 + (info.errorBoundPercent ?? DEFAULT_ERROR_PERCENT) / 100);
    const sphere = new THREE.Sphere(new THREE.Vector3(...shift), radius);
    this.geometry = createGeometry(drawing);
    this.geometry.boundingSphere = sphere;
    this.geometry.boundingBox = sphere.getBoundingBox(new THREE.Box3());
  }
}

/** Return a file with one segment as `OpenSegments`. */
export function asSegments(reel: OpenReel | OpenSegments): OpenSegments {
  if ("segments" in reel) return reel;
  const { nFrames, nVerts, nFaces, blocks } = reel.info;
  const sizeBytes = blocks.reduce((sum: number, block: BlockInfo) => sum + block.sizeBytes, 0);
  return {
    info: reel.info,
    segments: [{ start: 0, nFrames, nVerts, nFaces, sizeBytes }],
    first: reel,
    segment: () => Promise.resolve(reel),
    close: () => reel.close(),
  };
}

/** Create a geometry that draws nothing until there is a picture. */
function createGeometry(drawing: Drawing): THREE.BufferGeometry {
  const geometry = new THREE.BufferGeometry();
  geometry.setIndex(new THREE.BufferAttribute(drawing.index, 1));
  const none = { width: 3, values: new Float32Array(3) }; // until a backend replaces it
  const [position, normal] = ["position", "normal"].map((name) => ({ name, ...none }));
  for (const { name, width, values } of [position, normal, ...drawing.attributes]) {
    geometry.setAttribute(name, new THREE.BufferAttribute(values, width));
  }
  for (const { start, count, materialIndex } of drawing.groups) {
    geometry.addGroup(start, count, materialIndex);
  }
  geometry.setDrawRange(0, 0);
  return geometry;
}
