// Materials of surfaces.

import { Disposable } from "./events.js";
import { Color, type Matrix3, type Matrix4, type Uniform, Vector2 } from "./math.js";
import type { Texture } from "./textures.js";

export const [FrontSide, DoubleSide] = [0, 2];
export const GLSL3 = "300 es";

/** Properties that all materials have. */
export class Material extends Disposable {
  name = "";
  opacity = 1;
  transparent = false;
  /** Whether colors are multiplied by their opacity already. */
  premultipliedAlpha = false;
  depthTest = true;
  depthWrite = true;
  /** Fragments of a lower opacity are discarded. */
  alphaTest = 0;
  side = FrontSide;
  vertexColors = false;
  polygonOffset = false;
  polygonOffsetFactor = 0;
  polygonOffsetUnits = 0;

  // Nothing to do: shaders are selected by the current properties.
  set needsUpdate(_: true) {}
}

/** A value for a shader. */
export interface IUniform<Value = UniformValue> {
  value: Value;
}

export type UniformValue = number | boolean | readonly number[] | Uniform | Matrix3 | Matrix4 | Texture | null;

/** A material with its own shaders. */
export class RawShaderMaterial extends Material {
  vertexShader = "";
  fragmentShader = "";
  uniforms: Record<string, IUniform<any>> = {}; // as in three.js

  constructor(options: Partial<RawShaderMaterial> & { glslVersion: string }) {
    super();
    Object.assign(this, options);
  }
}

/** A material without lighting. */
export class MeshBasicMaterial extends Material {
  readonly color = new Color();
  map: Texture | null = null;
  aoMap: Texture | null = null;
  aoMapIntensity = 1;

  constructor({ color, ...options }: MaterialOptions<MeshBasicMaterial> = {}) {
    super();
    setColor(this.color, color);
    Object.assign(this, options);
  }
}

/** A physically based material: metallic and roughness, as in glTF. */
export class MeshStandardMaterial extends Material {
  readonly color = new Color();
  readonly emissive = new Color(0);
  roughness = 1;
  metalness = 0;
  normalScale = new Vector2(1, 1);
  aoMapIntensity = 1;
  flatShading = false;
  /** Whether colors represent values, so that they must look as in the legend in any light. */
  showsValues = false;
  map: Texture | null = null;
  roughnessMap: Texture | null = null;
  metalnessMap: Texture | null = null;
  normalMap: Texture | null = null;
  aoMap: Texture | null = null;
  emissiveMap: Texture | null = null;

  constructor({ color, emissive, ...options }: MaterialOptions<MeshStandardMaterial>) {
    super();
    setColor(this.color, color);
    setColor(this.emissive, emissive);
    Object.assign(this, options);
  }
}

type MaterialOptions<Kind> = Partial<Omit<Kind, "color" | "emissive"> & { color: Color | number; emissive: Color }>;

function setColor(color: Color, value: Color | number | undefined): void {
  if (value !== undefined) color.set(value);
}
