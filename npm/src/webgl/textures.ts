// Textures and render targets. Constants have the values of WebGL.

import { Disposable } from "./events.js";
import { Matrix3, Vector2 } from "./math.js";

export const SRGBColorSpace = "srgb";
export const [RepeatWrapping, MirroredRepeatWrapping, ClampToEdgeWrapping] = [0x2901, 0x8370, 0x812f];
export const [NearestFilter, LinearFilter, LinearMipmapLinearFilter] = [0x2600, 0x2601, 0x2703];
export const [UnsignedByteType, ShortType, UnsignedIntType, FloatType] = [0x1401, 0x1402, 0x1405, 0x1406];
export const [RGBAFormat, RGIntegerFormat, RGBAIntegerFormat] = [0x1908, 0x8228, 0x8d99];

type PixelArray = Float32Array | Uint32Array | Int16Array | Uint8Array;

/** The pixels of a texture in memory. */
export interface PixelData {
  data: PixelArray | null;
  readonly width: number;
  readonly height: number;
  readonly depth?: number;
}

/** An image on the GPU, which is uploaded when `needsUpdate` has been set. */
export class Texture<Image = unknown> extends Disposable {
  readonly isTexture = true;
  image: Image;
  /** Number of changes. */
  version = 0;
  /** UV set. */
  channel = 0;
  colorSpace = "";
  flipY = true;
  generateMipmaps = true;
  internalFormat: string | null = null;
  type = UnsignedByteType;
  format = RGBAFormat;
  wrapS = ClampToEdgeWrapping;
  wrapT = ClampToEdgeWrapping;
  minFilter = LinearMipmapLinearFilter;
  magFilter = LinearFilter;
  /** Transforms UVs; computed from `repeat` and `offset` if `matrixAutoUpdate` is true. */
  readonly matrix = new Matrix3();
  matrixAutoUpdate = true;
  readonly repeat = new Vector2(1, 1);
  readonly offset = new Vector2();
  /** Called after an upload. */
  onUpdate: (() => void) | null = null;

  constructor(image: Image = null as Image) {
    super();
    this.image = image;
  }

  set needsUpdate(_: true) {
    this.version++;
  }

  /** Create a texture of the same image. */
  clone(): Texture<Image> {
    const clone = new Texture(this.image);
    const { flipY, colorSpace, wrapS, wrapT } = this;
    return Object.assign(clone, { flipY, colorSpace, wrapS, wrapT });
  }

  updateMatrix(): void {
    const { repeat, offset, matrix } = this;
    if (this.matrixAutoUpdate) matrix.copy(new Matrix3(repeat.x, 0, offset.x, 0, repeat.y, offset.y));
  }
}

export class CanvasTexture extends Texture<HTMLCanvasElement> {
  override version = 1;
}

/** A texture of numbers in memory, not interpolated by default. */
export class DataTexture extends Texture<PixelData> {
  constructor(data: PixelArray | null, width: number, height: number, depth?: number) {
    super({ data, width, height, depth });
    this.flipY = this.generateMipmaps = false;
    this.minFilter = this.magFilter = NearestFilter;
  }
}

/** A texture of several layers. */
export class DataArrayTexture extends DataTexture {
  constructor(data: PixelArray, width: number, height: number, depth: number) {
    super(data, width, height, depth);
  }
}

/** Settings of a render target. */
export interface RenderTargetOptions {
  readonly type?: number;
  readonly format?: number;
  readonly internalFormat?: string;
  readonly depthBuffer: false;
  /** Whether mipmaps are rebuilt after each drawing. */
  readonly generateMipmaps?: boolean;
  readonly minFilter?: number;
  readonly magFilter?: number;
}

/** A texture to draw to, without a depth buffer. */
export class WebGLRenderTarget extends Disposable {
  readonly texture: DataTexture;

  constructor(
    readonly width: number,
    readonly height: number,
    { depthBuffer: _, ...options }: RenderTargetOptions,
  ) {
    super();
    this.texture = Object.assign(new DataTexture(null, width, height), { version: 1 }, options);
  }

  override dispose(): void {
    super.dispose();
    this.texture.dispose();
  }
}
