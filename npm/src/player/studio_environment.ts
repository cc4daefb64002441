// An environment map for metals: a neutral studio, brighter at the top, with two area lights.

import { DataTexture, LinearFilter, SRGBColorSpace } from "../webgl/index.js";

/** Radiance of a white pixel; set `Scene.environmentIntensity` to it. */
export const MAX_RADIANCE = 3;

/** Size in pixels: azimuth by elevation. */
const [WIDTH, HEIGHT] = [128, 64];

/** Radiance from below, from the horizon and from above; 1 is that of a white page. */
const [FLOOR, HORIZON, CEILING] = [0.12, 0.32, 0.6];

/** Azimuth and elevation of the center, half width and half height, in degrees; radiance. */
const AREA_LIGHTS = [
  [-40, 40, 32, 18, 2.4],
  [75, 15, 14, 40, 1.3],
] as const;

/** Create a texture for `Scene.environment`; its front faces +z, where the camera is. */
export function studioEnvironment(): DataTexture {
  const pixels = new Uint8Array(4 * WIDTH * HEIGHT);
  for (let i = 0; i < WIDTH * HEIGHT; i++) {
    const elevation = ((Math.floor(i / WIDTH) + 0.5) / HEIGHT - 0.5) * 180;
    const azimuth = (((i % WIDTH) + 0.5) / WIDTH) * 360 - 90;
    pixels.fill(255 * (radianceAt(azimuth, elevation) / MAX_RADIANCE) ** (1 / 2.2), 4 * i, 4 * i + 4);
  }
  const texture = new DataTexture(pixels, WIDTH, HEIGHT);
  texture.colorSpace = SRGBColorSpace;
  texture.magFilter = texture.minFilter = LinearFilter;
  texture.needsUpdate = true;
  return texture;
}

/** Radiance from a direction in degrees: azimuth from the front to the right, and elevation. */
function radianceAt(azimuth: number, elevation: number): number {
  const height = Math.sin((elevation * Math.PI) / 180);
  const limit = height > 0 ? CEILING : FLOOR;
  let sum = HORIZON + (limit - HORIZON) * Math.sqrt(Math.abs(height));
  for (const [centerAzimuth, centerElevation, halfWidth, halfHeight, radiance] of AREA_LIGHTS) {
    const horizontal = Math.abs(((azimuth - centerAzimuth + 540) % 360) - 180) / halfWidth;
    const vertical = Math.abs(elevation - centerElevation) / halfHeight;
    // The outer fifth of a light is a soft edge.
    sum += radiance * Math.min(Math.max(5 - 5 * Math.max(horizontal, vertical), 0), 1);
  }
  return sum;
}
