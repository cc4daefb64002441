// Faces that tracks hide: holes of scans, and deleted elements of simulations.

import type { OpenReel, Surface, TrackValues } from "../types.js";
import { createItemLookup } from "./corners.js";
import type { Drawing } from "./drawing.js";

/** Names of tracks of faces, one number each, that hide the faces where it is 0. */
const FACE_MASKS = ["scanned", "alive"];

/** The values of all masks in a frame. */
export type FrameMasks = readonly TrackValues[];

/** Decode the masks of each frame of a block; null if the file has none. */
export async function loadMasks(
  reel: OpenReel,
  block: number,
  signal: AbortSignal,
): Promise<readonly FrameMasks[] | null> {
  const masks = reel.info.tracks.filter(
    ({ name, domain, nColumns }) => FACE_MASKS.includes(name) && domain === "face" && nColumns === 1,
  );
  if (!masks.length) return null;
  const { start, nFrames } = reel.info.blocks[block];
  const tracks = masks.map(({ name }) => reel.track(name));
  return Promise.all(
    Array.from({ length: nFrames }, (_, t) =>
      Promise.all(tracks.map((track) => track.frame(start + t, null, { signal }))),
    ),
  );
}

/**
 * Write the index of a drawing with the triangles of hidden faces collapsed to a vertex, which draws
 * nothing and keeps the ranges of materials.
 */
export function maskIndex(
  { index, order }: Drawing,
  surface: Surface,
  masks: FrameMasks,
  into: Uint32Array,
): void {
  const faceAt = createItemLookup(surface)("face");
  into.set(index);
  for (let at = 0; at < index.length; at += 3) {
    const face = faceAt(order ? 3 * order[at / 3] : at);
    if (masks.some((values) => Number(values[face]) === 0)) into.fill(index[at], at, at + 3);
  }
}
