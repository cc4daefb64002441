// Vertex buffers.

import { Disposable } from "./events.js";
import { type Box3, type Sphere, type Vector3 } from "./math.js";

export const [StaticDrawUsage, DynamicDrawUsage] = [0x88e4, 0x88e8];

/** Numbers per vertex, or the index. */
export class BufferAttribute {
  usage = StaticDrawUsage;
  /** Number of changes. */
  version = 0;

  constructor(
    readonly array: Float32Array | Uint32Array,
    readonly itemSize: number,
  ) {}

  get count(): number {
    return this.array.length / this.itemSize;
  }

  set needsUpdate(_: true) {
    this.version++;
  }

  setUsage(usage: number): this {
    this.usage = usage;
    return this;
  }
}

/** An attribute whose floats are on the GPU only. */
export class GLBufferAttribute {
  constructor(
    readonly buffer: WebGLBuffer,
    readonly type: number,
    readonly itemSize: number,
    readonly elementSize: number,
    readonly count: number,
  ) {}
}

/** For types of three.js. */
export type NormalOrGLBufferAttributes = Record<string, BufferAttribute | GLBufferAttribute>;

/** Vertices and triangles. */
export class BufferGeometry<
  Attributes extends NormalOrGLBufferAttributes = Record<string, BufferAttribute>,
> extends Disposable {
  index: BufferAttribute | null = null;
  attributes: Record<string, Attributes[string]> = {};
  groups: { start: number; count: number; materialIndex?: number }[] = [];
  drawRange = { start: 0, count: Infinity };
  boundingSphere: Sphere | null = null;
  boundingBox: Box3 | null = null;

  setIndex(index: BufferAttribute | null): void {
    this.index = index;
  }

  getAttribute(name: string): Attributes[string] {
    return this.attributes[name];
  }

  setAttribute(name: string, attribute: Attributes[string]): void {
    this.attributes[name] = attribute;
  }

  deleteAttribute(name: string): void {
    delete this.attributes[name];
  }

  setDrawRange(start: number, count: number): void {
    this.drawRange = { start, count };
  }

  setFromPoints(points: readonly Vector3[]): this {
    const positions = Float32Array.from(points.flatMap((point) => point.toArray()));
    this.setAttribute("position", new BufferAttribute(positions, 3) as Attributes[string]);
    return this;
  }
}
