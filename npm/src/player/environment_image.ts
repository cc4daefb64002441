// Loads the image of `environment-image`: an equirectangular panorama, also in Radiance HDR.

import { SourceError } from "../errors.js";
import { DataTexture, FloatType, LinearFilter, SRGBColorSpace, Texture } from "../webgl/index.js";

/** Panoramas have no more pixels than this: a broken header must not exhaust memory. */
const MAX_PIXELS = 2 ** 26;

/**
 * Load a panorama for `Scene.environment`.
 *
 * @throws SourceError if it cannot be loaded or decoded.
 */
export async function loadEnvironmentImage(address: string, signal: AbortSignal): Promise<Texture> {
  let bytes: Uint8Array<ArrayBuffer>;
  try {
    const response = await fetch(address, { signal });
    if (!response.ok) throw new Error(`HTTP ${response.status}`);
    bytes = new Uint8Array(await response.arrayBuffer());
  } catch (error) {
    signal.throwIfAborted();
    throw new SourceError(`cannot load environment-image ${address}: ${(error as Error).message}`);
  }
  try {
    const texture = isRadiance(bytes) ? decodeRadiance(bytes) : await decodeImage(bytes);
    texture.magFilter = texture.minFilter = LinearFilter;
    texture.needsUpdate = true;
    return texture;
  } catch (error) {
    const formats = "use a PNG, JPEG, WebP or Radiance HDR file";
    throw new SourceError(`cannot decode environment-image ${address}; ${formats} (${error})`);
  }
}

async function decodeImage(bytes: Uint8Array<ArrayBuffer>): Promise<Texture> {
  const options = { imageOrientation: "flipY", colorSpaceConversion: "none" } as const;
  const texture = new Texture(await createImageBitmap(new Blob([bytes]), options));
  texture.flipY = false;
  texture.colorSpace = SRGBColorSpace;
  return texture;
}

function isRadiance(bytes: Uint8Array): boolean {
  return bytes[0] === 35 && bytes[1] === 63; // "#?"
}

/** Decode a Radiance HDR image: rows from top to bottom, as RGBE, run-length encoded or flat. */
function decodeRadiance(bytes: Uint8Array): DataTexture {
  let position = 0;
  const readLine = (): string => {
    const end = bytes.indexOf(10, position);
    if (end < 0) throw new Error("the header does not end");
    const line = String.fromCharCode(...bytes.subarray(position, end));
    position = end + 1;
    return line;
  };
  while (readLine().trim() !== "");
  const size = /^-Y (\d+) \+X (\d+)/.exec(readLine());
  const [height, width] = [Number(size?.[1]), Number(size?.[2])];
  if (!(width > 0 && height > 0 && width * height <= MAX_PIXELS)) throw new Error("unknown size");
  const pixels = new Float32Array(4 * width * height).fill(1);
  const row = new Uint8Array(4 * width); // red, green, blue and exponents, one after the other
  for (let y = height - 1; y >= 0; y--) {
    position = readRow(bytes, position, row, width);
    for (let x = 0; x < width; x++) {
      const scale = 2 ** (row[3 * width + x] - 136);
      const at = 4 * (y * width + x);
      for (let i = 0; i < 3; i++) {
        pixels[at + i] = Math.min(row[i * width + x] * scale, 65504);
      }
    }
  }
  // Half floats, since not every GPU interpolates floats.
  return Object.assign(new DataTexture(pixels, width, height), { type: FloatType, internalFormat: "RGBA16F" });
}

/** Read a row of pixels into planes; returns the position after it. */
function readRow(bytes: Uint8Array, from: number, row: Uint8Array, width: number): number {
  let position = from;
  const isPacked = bytes[position] === 2 && bytes[position + 1] === 2 && bytes[position + 2] < 128;
  if (!isPacked) {
    for (let i = 0; i < 4 * width; i++) row[(i % 4) * width + (i >> 2)] = bytes[position + i];
    position += 4 * width;
  } else {
    position += 4;
    for (let filled = 0; filled < 4 * width; ) {
      const count = bytes[position++];
      const isRun = count > 128;
      const length = isRun ? count - 128 : count;
      if (!length || filled + length > 4 * width) throw new Error("a row is damaged");
      if (isRun) row.fill(bytes[position++], filled, filled + length);
      else row.set(bytes.subarray(position, (position += length)), filled);
      filled += length;
    }
  }
  if (position > bytes.length) throw new Error("the file is truncated");
  return position;
}
