// Vectors, matrices and colors.

/** A vector or color that shaders receive as an array. */
export interface Uniform {
  toArray(): number[];
}

export class Vector2 {
  constructor(
    public x = 0,
    public y = 0,
  ) {}

  set(x: number, y: number): this {
    return Object.assign(this, { x, y });
  }

  toArray(): number[] {
    return [this.x, this.y];
  }
}

export class Vector3 {
  constructor(
    public x = 0,
    public y = 0,
    public z = 0,
  ) {}

  set(x: number, y: number, z: number): this {
    [this.x, this.y, this.z] = [x, y, z];
    return this;
  }

  /** Set from a distance, an angle from +y, and an azimuth from +z to +x, in radians. */
  setFromSphericalCoords(radius: number, phi: number, theta: number): this {
    const side = radius * Math.sin(phi);
    return this.set(side * Math.sin(theta), radius * Math.cos(phi), side * Math.cos(theta));
  }

  copy({ x, y, z }: Vector3): this {
    return this.set(x, y, z);
  }

  clone(): Vector3 {
    return new Vector3(this.x, this.y, this.z);
  }

  add(other: Vector3): this {
    return this.addScaledVector(other, 1);
  }

  sub(other: Vector3): this {
    return this.addScaledVector(other, -1);
  }

  addScaledVector({ x, y, z }: Vector3, scale: number): this {
    return this.set(this.x + scale * x, this.y + scale * y, this.z + scale * z);
  }

  subVectors(one: Vector3, other: Vector3): this {
    return this.copy(one).sub(other);
  }

  multiplyScalar(scale: number): this {
    return this.set(this.x * scale, this.y * scale, this.z * scale);
  }

  negate(): this {
    return this.multiplyScalar(-1);
  }

  min({ x, y, z }: Vector3): this {
    return this.set(Math.min(this.x, x), Math.min(this.y, y), Math.min(this.z, z));
  }

  max({ x, y, z }: Vector3): this {
    return this.set(Math.max(this.x, x), Math.max(this.y, y), Math.max(this.z, z));
  }

  dot({ x, y, z }: Vector3): number {
    return this.x * x + this.y * y + this.z * z;
  }

  length(): number {
    return Math.hypot(this.x, this.y, this.z);
  }

  normalize(): this {
    return this.multiplyScalar(1 / (this.length() || 1));
  }

  distanceTo({ x, y, z }: Vector3): number {
    return Math.hypot(this.x - x, this.y - y, this.z - z);
  }

  cross(other: Vector3): this {
    return this.crossVectors(this, other);
  }

  crossVectors(a: Vector3, b: Vector3): this {
    return this.set(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
  }

  /** Transform a point by an affine matrix. */
  applyMatrix4({ elements: e }: Matrix4): this {
    const { x, y, z } = this;
    const row = (i: number) => e[i] * x + e[i + 4] * y + e[i + 8] * z + e[i + 12];
    return this.set(row(0), row(1), row(2));
  }

  fromArray(values: ArrayLike<number>, offset = 0): this {
    return this.set(values[offset], values[offset + 1], values[offset + 2]);
  }

  fromBufferAttribute({ array }: { array: ArrayLike<number> }, index: number): this {
    return this.fromArray(array, 3 * index);
  }

  toArray(into: { [index: number]: number } = [], offset = 0): number[] {
    [into[offset], into[offset + 1], into[offset + 2]] = [this.x, this.y, this.z];
    return into as number[];
  }
}

export class Vector4 {
  #values = [0, 0, 0, 0];

  set(...values: [number, number, number, number]): this {
    this.#values = values;
    return this;
  }

  toArray(): number[] {
    return this.#values;
  }
}

/** A matrix of three columns; the constructor takes it by rows. */
export class Matrix3 {
  elements: number[];

  constructor(a = 1, b = 0, c = 0, d = 0, e = 1, f = 0, g = 0, h = 0, i = 1) {
    this.elements = [a, d, g, b, e, h, c, f, i];
  }

  copy({ elements }: Matrix3): this {
    this.elements = [...elements];
    return this;
  }

  clone(): Matrix3 {
    return new Matrix3().copy(this);
  }
}

/** A matrix of four columns. */
export class Matrix4 {
  elements = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

  copy({ elements }: Matrix4): this {
    this.elements = [...elements];
    return this;
  }

  /** Set three axes and an origin. */
  setAxes(...columns: readonly [x: Vector3, y: Vector3, z: Vector3, origin: Vector3]): this {
    this.elements = columns.flatMap((column, i) => [...column.toArray(), Number(i === 3)]);
    return this;
  }

  /** Set to a projection in perspective, from half the size of the view at distance 1. */
  setPerspective(halfWidth: number, halfHeight: number, near: number, far: number): this {
    const [z, w] = [(far + near) / (near - far), (2 * far * near) / (near - far)];
    this.elements = [1 / halfWidth, 0, 0, 0, 0, 1 / halfHeight, 0, 0, 0, 0, z, -1, 0, 0, w, 0];
    return this;
  }

  multiplyMatrices({ elements: a }: Matrix4, { elements: b }: Matrix4): this {
    this.elements = b.map((_, i) => {
      const column = i & 12;
      let sum = 0;
      for (let k = 0; k < 4; k++) sum += a[(i & 3) + 4 * k] * b[column + k];
      return sum;
    });
    return this;
  }

  /** Set to the inverse of an affine matrix. */
  copyInverse({ elements: e }: Matrix4): this {
    const [x, y, z, origin] = [0, 4, 8, 12].map((from) => new Vector3().fromArray(e, from));
    const rows = [y.clone().cross(z), z.clone().cross(x), x.clone().cross(y)];
    const scale = 1 / (rows[0].dot(x) || 1);
    const [a, b, c] = rows.map((row) => row.multiplyScalar(scale));
    const [p, q, r] = rows.map((row) => -row.dot(origin));
    this.elements = [a.x, b.x, c.x, 0, a.y, b.y, c.y, 0, a.z, b.z, c.z, 0, p, q, r, 1];
    return this;
  }
}

export class Sphere {
  constructor(
    readonly center = new Vector3(),
    readonly radius = -1,
  ) {}

  getBoundingBox(box: Box3): Box3 {
    box.min.copy(this.center).addScaledVector(new Vector3(1, 1, 1), -this.radius);
    box.max.copy(this.center).addScaledVector(new Vector3(1, 1, 1), this.radius);
    return box;
  }
}

export class Box3 {
  readonly min = new Vector3();
  readonly max = new Vector3();
}

/** What a color is made from: 0xrrggbb, or a CSS color. */
export type ColorRepresentation = number | string | Color;

/** A linear color. */
export class Color {
  r = 1;
  g = 1;
  b = 1;

  constructor(color: ColorRepresentation = 0xffffff, ...others: number[]) {
    if (others.length) this.setRGB(color as number, others[0], others[1]);
    else this.set(color);
  }

  /** Set from sRGB. */
  set(color: ColorRepresentation): this {
    if (color instanceof Color) return this.copy(color);
    const hex = typeof color === "number" ? color : parseColor(color);
    const [r, g, b] = [16, 8, 0].map((shift) => toLinear(((hex >> shift) & 255) / 255));
    return this.setRGB(r, g, b);
  }

  setRGB(r: number, g: number, b: number): this {
    return Object.assign(this, { r, g, b });
  }

  copy({ r, g, b }: Color): this {
    return this.setRGB(r, g, b);
  }

  clone(): Color {
    return new Color().copy(this);
  }

  /** Return 0xrrggbb in sRGB. */
  getHex(_colorSpace: string): number {
    const [r, g, b] = this.toArray().map((one) => Math.min(Math.max(Math.round(255 * toSrgb(one)), 0), 255));
    return (r << 16) | (g << 8) | b;
  }

  toArray(): number[] {
    return [this.r, this.g, this.b];
  }
}

/** Return 0xrrggbb of a CSS color; white if it is invalid. */
function parseColor(color: string): number {
  const canvas = document.createElement("canvas").getContext("2d") as CanvasRenderingContext2D;
  canvas.fillStyle = "white";
  canvas.fillStyle = color;
  canvas.fillRect(0, 0, 1, 1);
  const [r, g, b] = canvas.getImageData(0, 0, 1, 1).data;
  return (r << 16) | (g << 8) | b;
}

function toLinear(value: number): number {
  return value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
}

function toSrgb(value: number): number {
  return value <= 0.0031308 ? value * 12.92 : 1.055 * value ** (1 / 2.4) - 0.055;
}
