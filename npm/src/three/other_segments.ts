// Prepares segments before they are shown. Loaded with the first one that follows another, since most
// files have a single segment.

import * as THREE from "three";

import type { MeshSegment } from "./mesh_segment.js";

/** Segments in memory: the current one, the next one, and the one before, whose shaders are shared. */
const MAX_SEGMENTS = 3;

/** The mesh that shows segments. */
export interface SegmentedMesh {
  /** Segments in memory, the one loaded last at the end. */
  readonly segments: ReadonlyMap<number, MeshSegment>;
  /** Return the shown segment. */
  current(): MeshSegment;
  initTexture(texture: THREE.Texture): void;
  /** Add the prepared segment. */
  add(): void;
  remove(segment: MeshSegment): void;
}

/** Prepare the images of a segment, and add it to the mesh in place of an unused one. */
export async function prepareSegment(
  segment: MeshSegment,
  mesh: SegmentedMesh,
  signal: AbortSignal,
): Promise<void> {
  await segment.materials?.imagesReady;
  if (signal.aborted) segment.dispose();
  signal.throwIfAborted();
  const unused = [...mesh.segments.values()].find((one) => one !== mesh.current() && !one.nBlocks);
  if (unused && mesh.segments.size >= MAX_SEGMENTS) mesh.remove(unused);
  mesh.add();
  for (const value of segment.materials?.list.flatMap((one) => Object.values(one)) ?? []) {
    if (value instanceof THREE.Texture) mesh.initTexture(value);
  }
}
