// Decodes the images of materials.

import * as THREE from "three";

import { InvalidInputError } from "../errors.js";
import type { Material, MaterialTexture, OpenReel } from "../types.js";

/** Dispatches an event of `ReelMesh`. */
export type SendEvent = (
  event: { type: "change" } | { type: "error"; error: Error; block: null },
) => void;

type Slots = Partial<Record<MapSlot, THREE.Texture>>;
type MapSlot = "map" | "metalnessMap" | "roughnessMap" | "normalMap" | "aoMap" | "emissiveMap";

const SLOTS: Record<MaterialTexture["slot"], MapSlot> = {
  baseColor: "map",
  metallic: "metalnessMap",
  roughness: "roughnessMap",
  normal: "normalMap",
  occlusion: "aoMap",
  emissive: "emissiveMap",
};

/** By wrap mode of the file; three.js does not support black. */
const WRAPS = [
  THREE.RepeatWrapping,
  THREE.MirroredRepeatWrapping,
  THREE.ClampToEdgeWrapping,
  THREE.ClampToEdgeWrapping,
  THREE.RepeatWrapping,
] as const;

/**
 * Read the images of a file, and assign each to materials once it is decoded.
 *
 * @param reel - the file that contains the images
 * @param definitions - the materials of the file; undefined for materials that it does not define
 * @param uvNames - names of UV attributes, by channel
 * @param send - called with "change" when an image is shown, or with "error"
 * @param signal - frees the images
 */
export async function applyImages(
  materials: readonly THREE.Material[],
  definitions: readonly (Material | undefined)[],
  reel: OpenReel,
  uvNames: readonly string[],
  send: SendEvent,
  signal: AbortSignal,
): Promise<void> {
  const textures: THREE.Texture[] = [];
  /** By image index: an image that several textures use is decoded once. */
  const decodedImages: Promise<THREE.Texture>[] = [];
  signal.addEventListener("abort", () => {
    for (const texture of textures) texture.dispose();
    for (const image of decodedImages) {
      image?.then(
        (texture) => (texture.image as ImageBitmap).close(),
        () => {}, // reported when decoding failed
      );
    }
  });
  const apply = async (material: THREE.Material, reference: MaterialTexture): Promise<void> => {
    const slot = SLOTS[reference.slot];
    if (!(slot in material)) return; // unlit materials have only the base color
    const { name, mediaType } = reel.surface.images[reference.image];
    const load = async () => decode(await reel.image(reference.image, { signal }), mediaType);
    try {
      const shared = await (decodedImages[reference.image] ??= load());
      if (signal.aborted) return;
      const channel = uvNames.indexOf(reference.uv);
      if (channel < 0) throw new Error(`there is no UV attribute ${reference.uv}`);
      const texture = shared.clone();
      texture.channel = channel;
      texture.wrapS = WRAPS[reference.wrapU];
      texture.wrapT = WRAPS[reference.wrapV];
      texture.matrixAutoUpdate = false;
      texture.matrix.copy(uvTransform(reference));
      if (slot === "map" || slot === "emissiveMap") texture.colorSpace = THREE.SRGBColorSpace;
      texture.needsUpdate = true;
      textures.push(texture);
      (material as Slots)[slot] = texture;
      material.needsUpdate = true;
      send({ type: "change" });
    } catch (thrown) {
      if (signal.aborted) return;
      send({ type: "error", error: new InvalidInputError(`cannot show ${name}: ${thrown}`), block: null });
    }
  };
  await Promise.all(
    materials.flatMap((material, i) => (definitions[i]?.textures ?? []).map((reference) => apply(material, reference))),
  );
}

/** Decode an image with v up and without color conversion. */
async function decode(bytes: Uint8Array, mediaType: string): Promise<THREE.Texture> {
  const blob = new Blob([bytes as Uint8Array<ArrayBuffer>], { type: mediaType });
  const bitmap = await createImageBitmap(blob, {
    imageOrientation: "flipY",
    premultiplyAlpha: "none",
    colorSpaceConversion: "none",
  });
  const texture = new THREE.Texture(bitmap);
  texture.flipY = false;
  return texture;
}

/** Convert a UV transform from v down, as in glTF, to v up. */
function uvTransform({ offset, rotation, scale }: MaterialTexture): THREE.Matrix3 {
  const [c, s] = [Math.cos(rotation), Math.sin(rotation)];
  const [x, y] = scale;
  const [u, v] = offset;
  return new THREE.Matrix3(c * x, -s * y, u + s * y, s * x, c * y, 1 - v - c * y, 0, 0, 1);
}
