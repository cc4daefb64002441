// Materials of three.js as the file says how faces look.

import * as THREE from "three";

import { InvalidInputError } from "../errors";
import type { Image, Material, MaterialTexture, Surface } from "../types";
import type { Drawing } from "./drawing";

type Standard = THREE.MeshStandardMaterial;
type MapSlot = "map" | "metalnessMap" | "roughnessMap" | "normalMap" | "aoMap" | "emissiveMap";

const SLOTS: Record<MaterialTexture["slot"], MapSlot> = {
  baseColor: "map",
  metallic: "metalnessMap",
  roughness: "roughnessMap",
  normal: "normalMap",
  occlusion: "aoMap",
  emissive: "emissiveMap",
};

/** By number of a way to wrap: three.js has no black outside. */
const WRAPS = [
  THREE.RepeatWrapping,
  THREE.MirroredRepeatWrapping,
  THREE.ClampToEdgeWrapping,
  THREE.ClampToEdgeWrapping,
  THREE.RepeatWrapping,
] as const;

/** Colour of faces about which the file says nothing. */
const PLAIN = 0x9eb0c4;

/** The materials of a surface; their images appear as they are decoded. */
export class Materials {
  /** By number in the groups of the drawing. */
  readonly list: readonly (Standard | THREE.MeshBasicMaterial)[];
  private readonly textures: THREE.Texture[] = [];
  private readonly bitmaps: ImageBitmap[] = [];
  private isOver = false;

  /** @param onError - is told of an image that cannot be shown */
  constructor(
    surface: Surface,
    private readonly drawing: Drawing,
    isFlat: boolean,
    private readonly onError: (error: Error) => void,
  ) {
    const hasColors = drawing.attributes.some(({ name }) => name === "color");
    const given = drawing.materialNames.map((name) =>
      surface.materials.find((one) => one.name === name),
    );
    this.list = given.map((one) => {
      const made = one ? materialOf(one) : plainMaterial(hasColors);
      made.vertexColors = hasColors;
      if ("flatShading" in made) made.flatShading = isFlat;
      return made;
    });
    surface.images.forEach((image, number) => {
      const uses = given.flatMap((one, i) =>
        (one?.textures ?? [])
          .filter((texture) => texture.image === number)
          .map((texture) => ({ texture, material: this.list[i] })),
      );
      if (uses.length) void this.load(image, uses);
    });
  }

  dispose(): void {
    this.isOver = true;
    for (const one of [...this.list, ...this.textures]) one.dispose();
    for (const bitmap of this.bitmaps) bitmap.close();
  }

  private async load(
    image: Image,
    uses: readonly { texture: MaterialTexture; material: THREE.Material }[],
  ): Promise<void> {
    try {
      const bitmap = await decoded(image);
      if (this.isOver) return bitmap.close();
      this.bitmaps.push(bitmap);
      const shared = new THREE.Texture(bitmap);
      for (const { texture, material } of uses) this.dress(material, texture, shared);
    } catch (error) {
      const reason = error instanceof Error ? error.message : String(error);
      const name = image.name || image.mediaType;
      if (!this.isOver) this.onError(new InvalidInputError(`cannot show image ${name}: ${reason}`));
    }
  }

  private dress(material: THREE.Material, given: MaterialTexture, shared: THREE.Texture): void {
    const slot = SLOTS[given.slot];
    if (!(slot in material)) return; // without light only the colour counts
    const texture = shared.clone();
    const channel = this.drawing.uvNames.indexOf(given.uv);
    if (channel < 0) throw new InvalidInputError(`there are no texture coordinates ${given.uv}`);
    texture.channel = channel;
    texture.flipY = false; // it was flipped when it was decoded
    texture.wrapS = WRAPS[given.wrapU] ?? THREE.RepeatWrapping;
    texture.wrapT = WRAPS[given.wrapV] ?? THREE.RepeatWrapping;
    texture.matrixAutoUpdate = false;
    texture.matrix.copy(transformOf(given));
    if (slot === "map" || slot === "emissiveMap") texture.colorSpace = THREE.SRGBColorSpace;
    texture.needsUpdate = true;
    this.textures.push(texture);
    (material as Standard)[slot] = texture;
    material.needsUpdate = true;
  }
}

/** Without numbers beyond the bytes of the image: with v upwards, as texture coordinates are. */
function decoded({ bytes, mediaType }: Image): Promise<ImageBitmap> {
  const blob = new Blob([bytes as Uint8Array<ArrayBuffer>], { type: mediaType });
  return createImageBitmap(blob, {
    imageOrientation: "flipY",
    premultiplyAlpha: "none",
    colorSpaceConversion: "none",
  });
}

/** Of texture coordinates with v upwards; the file says it with v downwards, as glTF does. */
function transformOf({ offset, rotation, scale }: MaterialTexture): THREE.Matrix3 {
  const [c, s] = [Math.cos(rotation), Math.sin(rotation)];
  const flip = new THREE.Matrix3(1, 0, 0, 0, -1, 1, 0, 0, 1);
  const [x, y] = scale;
  const down = new THREE.Matrix3(c * x, s * y, offset[0], -s * x, c * y, offset[1], 0, 0, 1);
  return flip.clone().multiply(down).multiply(flip);
}

function plainMaterial(hasColors: boolean): Standard {
  const color = hasColors ? 0xffffff : PLAIN;
  return new THREE.MeshStandardMaterial({ color, roughness: 0.8, side: THREE.DoubleSide });
}

function materialOf(given: Material): Standard | THREE.MeshBasicMaterial {
  const [red, green, blue, opacity] = given.baseColor;
  const isBlend = given.alphaMode === "blend";
  const common = {
    name: given.name,
    color: new THREE.Color(red, green, blue),
    opacity: given.alphaMode === "opaque" ? 1 : opacity,
    transparent: isBlend,
    depthWrite: !isBlend,
    alphaTest: given.alphaMode === "mask" ? given.alphaCutoff : 0,
    side: given.doubleSided ? THREE.DoubleSide : THREE.FrontSide,
  };
  if (given.unlit) return new THREE.MeshBasicMaterial(common);
  const strength = Math.max(1, ...given.emissive);
  const [r, g, b] = given.emissive.map((one) => one / strength);
  return new THREE.MeshStandardMaterial({
    ...common,
    metalness: given.metallic,
    roughness: given.roughness,
    emissive: new THREE.Color(r, g, b),
    emissiveIntensity: strength,
    normalScale: new THREE.Vector2(given.normalScale, given.normalScale),
    aoMapIntensity: given.occlusionStrength,
  });
}
