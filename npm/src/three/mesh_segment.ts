// A segment of a file as three.js draws it: its geometry, materials and backend.

import * as THREE from "three";

import type { BlockFields, OpenReel, OpenSegments, Surface } from "../types.js";
import type { Backend } from "./backend.js";
import type { Split } from "./corners.js";
import { createDrawing, type Drawing } from "./drawing.js";
import { type FrameMasks, maskIndex } from "./face_masks.js";
import type { LoadedBlock } from "./loaded_block.js";
import type { SendEvent } from "./material_images.js";
import { Materials } from "./materials.js";

/** Assumed error of positions, in percent of the diagonal, if the file guarantees no bound. */
const DEFAULT_ERROR_PERCENT = 10;

/** Options of a mesh that apply to each segment; see `ReelMeshOptions`. */
export interface SegmentOptions {
  readonly material?: THREE.Material | THREE.Material[];
  readonly flat?: boolean;
  readonly origin?: readonly [number, number, number];
}

/** A segment in memory. Its geometry draws nothing until there is a picture. */
export class MeshSegment {
  drawing!: Drawing;
  geometry!: THREE.BufferGeometry;
  /** Added to positions, which are relative to the center of the file. */
  readonly shift: readonly [number, number, number];
  /** Null if the page provides the material. */
  readonly materials: Materials | null;
  backend: Backend | null = null;
  /** Number of loaded blocks. */
  nBlocks = 0;
  /** Domain by which the vertices of the geometry are split. */
  split: Split | null = null;
  /** The surface to draw: that of the file, or of a cut through it. */
  surface: Surface;
  #drawn: Surface;
  /** Masks of the frames of each loaded block, if the file has masks. */
  readonly #masks = new Map<LoadedBlock, readonly FrameMasks[]>();
  /** Masks of the shown frame, if it has any. */
  #mask: FrameMasks | null = null;

  /**
   * @param number - index of the segment
   * @param send - sends events; passed to `Materials`
   */
  constructor(
    readonly number: number,
    readonly reel: OpenReel,
    { material, flat, origin = [0, 0, 0] }: SegmentOptions,
    send: SendEvent,
  ) {
    const [x, y, z] = reel.info.center;
    this.shift = [x - origin[0], y - origin[1], z - origin[2]];
    this.surface = this.#drawn = reel.surface;
    this.#createGeometry();
    this.materials = material ? null : new Materials(reel, this.drawing, flat ?? !!reel.surface.cells, send);
  }

  /** The materials of the file as `THREE.Mesh` expects them. */
  get material(): THREE.Material | THREE.Material[] | undefined {
    const list = this.materials?.list;
    return this.drawing.groups.length ? list : list?.[0];
  }

  /** Prepare the geometry for a new backend; replaces it if the split or the surface changes. */
  rebuildGeometry(split: Split | null): void {
    this.geometry.dispose(); // also frees the buffers of attributes that will be replaced
    if (split === this.split && this.surface === this.#drawn) return;
    this.split = split;
    this.#drawn = this.surface;
    this.#createGeometry();
  }

  /** Store a block for pictures. @throws Error if the GPU does not support it */
  upload(fields: BlockFields, block: LoadedBlock, masks: readonly FrameMasks[] | null): void {
    this.backend?.upload(fields, block);
    if (masks) this.#masks.set(block, masks);
    this.nBlocks++;
  }

  release(block: LoadedBlock): void {
    this.backend?.release(block);
    this.#masks.delete(block);
    this.nBlocks--;
  }

  /** Draw all triangles but those of faces that are hidden in frame `t` of a block. */
  showFaces(block: LoadedBlock, t: number): void {
    this.geometry.setDrawRange(0, Infinity);
    const mask = this.#masks.get(block)?.[t];
    if (!mask || mask === this.#mask || this.surface !== this.reel.surface) return;
    this.#mask = mask;
    const index = this.geometry.index as THREE.BufferAttribute;
    maskIndex(this.drawing, this.surface, mask, index.array as Uint32Array);
    index.needsUpdate = true;
  }

  dispose(): void {
    this.backend?.dispose();
    this.geometry.dispose();
    this.materials?.dispose();
  }

  /** Create the geometry; its bounds contain all frames, including the coding error. */
  #createGeometry(): void {
    const { info } = this.reel;
    const drawing = (this.drawing = createDrawing(this.surface, info.nVerts, this.split));
    const geometry = (this.geometry = new THREE.BufferGeometry());
    geometry.setIndex(new THREE.BufferAttribute(drawing.index.slice(), 1)); // masks change it
    this.#mask = null;
    for (const { name, width, values } of drawing.attributes) {
      geometry.setAttribute(name, new THREE.BufferAttribute(values, width));
    }
    for (const name of ["position", "normal"]) {
      geometry.setAttribute(name, new THREE.BufferAttribute(new Float32Array(3), 3)); // until there is a backend
    }
    geometry.groups = [...drawing.groups];
    geometry.setDrawRange(0, 0);
    const radius = info.diagonal * (0.5 + (info.errorBoundPercent ?? DEFAULT_ERROR_PERCENT) / 100);
    const sphere = new THREE.Sphere(new THREE.Vector3(...this.shift), radius);
    geometry.boundingSphere = sphere;
    geometry.boundingBox = sphere.getBoundingBox(new THREE.Box3());
  }
}

/** Return a file with one segment as `OpenSegments`. */
export function asSegments(reel: OpenReel | OpenSegments): OpenSegments {
  if ("segments" in reel) return reel;
  const { info } = reel;
  const sizeBytes = info.blocks.reduce((sum, block) => sum + block.sizeBytes, 0);
  return {
    info,
    segments: [{ ...info, start: 0, sizeBytes }],
    first: reel,
    segment: async () => reel,
    close: () => reel.close(),
  };
}
