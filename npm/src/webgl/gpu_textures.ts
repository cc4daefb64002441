// Textures and framebuffers on the GPU.

import type { Disposable } from "./events.js";
import {
  FloatType,
  LinearMipmapLinearFilter,
  type PixelData,
  SRGBColorSpace,
  type Texture,
  type WebGLRenderTarget,
} from "./textures.js";

/** A texture on the GPU. */
interface Entry {
  readonly handle: WebGLTexture;
  /** Kind of texture, as a constant of WebGL. */
  readonly target: number;
  version: number;
  /** Number of textures that share it: those of the same image. */
  nUsers: number;
}

/**
 * Uploads textures when they are used, and frees them when they are disposed of, unless their context
 * was lost meanwhile.
 */
export class GpuTextures {
  readonly #gl: WebGL2RenderingContext;
  readonly #maxSize: number;
  readonly #entries = new WeakMap<Texture, Entry>();
  /** Entries of images, by their settings. */
  readonly #shared = new WeakMap<object, Map<string, Entry>>();
  readonly #framebuffers = new WeakMap<WebGLRenderTarget, WebGLFramebuffer>();

  constructor(gl: WebGL2RenderingContext) {
    this.#gl = gl;
    this.#maxSize = gl.getParameter(gl.MAX_TEXTURE_SIZE) as number;
    gl.pixelStorei(gl.UNPACK_COLORSPACE_CONVERSION_WEBGL, gl.NONE);
  }

  /** Bind a texture to a unit, and upload it if it has changed. */
  bind(texture: Texture | null, unit = 0): void {
    const gl = this.#gl;
    gl.activeTexture(gl.TEXTURE0 + unit);
    if (!texture) return;
    const entry = this.#entries.get(texture) ?? this.#share(texture) ?? this.#add(texture);
    gl.bindTexture(entry.target, entry.handle);
    if (entry.version === texture.version) return;
    entry.version = texture.version;
    this.#upload(texture, entry.target);
  }

  /** The WebGL texture; undefined before it is used. */
  handleOf(texture: Texture): WebGLTexture | undefined {
    return this.#entries.get(texture)?.handle;
  }

  #add(texture: Texture): Entry {
    const target = asData(texture).depth ? this.#gl.TEXTURE_2D_ARRAY : this.#gl.TEXTURE_2D;
    const entry = { handle: this.#gl.createTexture(), target, version: 0, nUsers: 1 };
    this.#register(texture, entry);
    return entry;
  }

  /** Return the framebuffer of a render target. */
  framebuffer(target: WebGLRenderTarget): WebGLFramebuffer {
    const gl = this.#gl;
    let framebuffer = this.#framebuffers.get(target);
    if (framebuffer) return framebuffer;
    this.#framebuffers.set(target, (framebuffer = gl.createFramebuffer()));
    this.bind(target.texture);
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    const handle = this.handleOf(target.texture) as WebGLTexture;
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, handle, 0);
    onDispose(target, () => {
      if (gl.isFramebuffer(framebuffer)) gl.deleteFramebuffer(framebuffer);
      this.#framebuffers.delete(target);
    });
    return framebuffer;
  }

  #register(texture: Texture, entry: Entry): void {
    this.#entries.set(texture, entry);
    onDispose(texture, () => {
      this.#entries.delete(texture);
      const isLast = --entry.nUsers === 0;
      if (isLast && this.#gl.isTexture(entry.handle)) this.#gl.deleteTexture(entry.handle);
    });
  }

  /** Return the entry of the same bitmap with the same settings; null for other textures. */
  #share(texture: Texture): Entry | null {
    const { image, colorSpace, wrapS, wrapT, version } = texture;
    if (!(image instanceof ImageBitmap)) return null;
    const entries = this.#shared.get(image) ?? new Map<string, Entry>();
    this.#shared.set(image, entries);
    const key = `${colorSpace} ${wrapS} ${wrapT}`;
    const shared = entries.get(key);
    if (!shared?.nUsers) {
      const entry = this.#add(texture);
      entries.set(key, entry);
      return entry;
    }
    shared.nUsers++;
    shared.version = version;
    this.#register(texture, shared);
    return shared;
  }

  #upload(texture: Texture, target: number): void {
    const gl = this.#gl;
    const { format, type, flipY, generateMipmaps, minFilter } = texture;
    const ofBytes = texture.colorSpace === SRGBColorSpace ? "SRGB8_ALPHA8" : "RGBA8";
    const name = texture.internalFormat ?? (type === FloatType ? "RGBA32F" : ofBytes);
    const internalFormat = gl[name as "RGBA8"];
    gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, flipY);
    const { data, width, height, depth } = asData(texture);
    if (data === undefined) {
      gl.texImage2D(target, 0, internalFormat, format, type, this.#fit(texture.image as HTMLCanvasElement));
    } else if (depth) gl.texImage3D(target, 0, internalFormat, width, height, depth, 0, format, type, data);
    else gl.texImage2D(target, 0, internalFormat, width, height, 0, format, type, data);
    gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, false);
    const set = (name: number, value: number) => gl.texParameteri(target, name, value);
    set(gl.TEXTURE_WRAP_S, texture.wrapS);
    set(gl.TEXTURE_WRAP_T, texture.wrapT);
    set(gl.TEXTURE_MAG_FILTER, texture.magFilter);
    set(gl.TEXTURE_MIN_FILTER, minFilter);
    if (generateMipmaps && minFilter === LinearMipmapLinearFilter) gl.generateMipmap(target);
    texture.onUpdate?.();
  }

  /** Scale an image down to the largest size that the GPU supports. */
  #fit(image: HTMLCanvasElement | ImageBitmap | HTMLImageElement): TexImageSource {
    const scale = this.#maxSize / Math.max(image.width, image.height);
    if (!(scale < 1)) return image;
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [Math.floor(image.width * scale), Math.floor(image.height * scale)];
    canvas.getContext("2d")?.drawImage(image, 0, 0, canvas.width, canvas.height);
    const size = `${image.width} x ${image.height}`;
    console.warn(`a texture of ${size} pixels is scaled down to the limit of the GPU, ${this.#maxSize}`);
    return canvas;
  }
}

function asData(texture: Texture): Partial<PixelData> & Pick<PixelData, "width" | "height"> {
  return texture.image as PixelData;
}

/** Call a function when a resource is disposed of, once. */
export function onDispose(resource: Disposable, free: () => void): void {
  const listener = () => {
    resource.removeEventListener("dispose", listener);
    free();
  };
  resource.addEventListener("dispose", listener);
}
