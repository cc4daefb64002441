// What metals reflect: a neutral studio, bright above, with two lights like large windows.

import { DataTexture, EquirectangularReflectionMapping, LinearFilter, SRGBColorSpace } from "three";

/** Light of a white pixel: what `Scene.environmentIntensity` has to be. */
export const WHITEST = 3;

/** Pixels around, and from below upwards. */
const [WIDTH, HEIGHT] = [128, 64];

/** Light from below, from the horizon and from above; 1 is that of a white page. */
const [FLOOR, HORIZON, CEILING] = [0.12, 0.32, 0.6];

/** Lights: angles of their middle around and upwards and half their sizes, in degrees, and light. */
const WINDOWS = [
  [-40, 40, 32, 18, 2.4],
  [75, 15, 14, 40, 1.3],
] as const;

/** An environment for `Scene.environment`; +z, where the camera is, is its front. */
export function studioTexture(): DataTexture {
  const pixels = new Uint8Array(4 * WIDTH * HEIGHT);
  for (let i = 0; i < WIDTH * HEIGHT; i++) {
    const up = ((Math.floor(i / WIDTH) + 0.5) / HEIGHT - 0.5) * 180;
    const around = (((i % WIDTH) + 0.5) / WIDTH) * 360 - 90;
    pixels.fill(255 * (lightAt(around, up) / WHITEST) ** (1 / 2.2), 4 * i, 4 * i + 4);
  }
  const texture = new DataTexture(pixels, WIDTH, HEIGHT);
  texture.colorSpace = SRGBColorSpace;
  texture.mapping = EquirectangularReflectionMapping;
  texture.magFilter = texture.minFilter = LinearFilter;
  texture.needsUpdate = true;
  return texture;
}

/** Light from a direction, in degrees: around from the front to the right, and upwards. */
function lightAt(around: number, up: number): number {
  const height = Math.sin((up * Math.PI) / 180);
  const end = height > 0 ? CEILING : FLOOR;
  let light = HORIZON + (end - HORIZON) * Math.sqrt(Math.abs(height));
  for (const [middle, high, halfWidth, halfHeight, more] of WINDOWS) {
    const aside = Math.abs(((around - middle + 540) % 360) - 180) / halfWidth;
    const above = Math.abs(up - high) / halfHeight;
    // Soft edges: the outer fifth.
    light += more * Math.min(Math.max(5 - 5 * Math.max(aside, above), 0), 1);
  }
  return light;
}
