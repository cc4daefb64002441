// The scene: objects with positions, meshes and cameras.

import { EventDispatcher } from "./events.js";
import { BufferAttribute, BufferGeometry } from "./geometry.js";
import { DoubleSide, type Material } from "./materials.js";
import { Matrix4, Vector3 } from "./math.js";
import type { Intersection, Raycaster } from "./raycaster.js";

/** Events of all objects. */
export interface Object3DEventMap {
  dispose: object;
}

/** A node of the scene. */
export class Object3D<Events extends object = Object3DEventMap> extends EventDispatcher<Events> {
  name = "";
  visible = true;
  frustumCulled = true; // ignored: scenes are small
  /** Objects of higher order are drawn later. */
  renderOrder = 0;
  parent: Object3D<any> | null = null;
  readonly children: Object3D<any>[] = [];
  readonly position = new Vector3();
  readonly scale = new Vector3(1, 1, 1);
  /** Rotation, applied after the scale. */
  readonly axes = [new Vector3(1, 0, 0), new Vector3(0, 1, 0), new Vector3(0, 0, 1)] as const;
  readonly matrixWorld = new Matrix4();

  add(...objects: Object3D<any>[]): this {
    for (const object of objects) {
      object.removeFromParent();
      object.parent = this;
      this.children.push(object);
    }
    return this;
  }

  removeFromParent(): this {
    const siblings = this.parent?.children ?? [];
    if (this.parent) siblings.splice(siblings.indexOf(this), 1);
    this.parent = null;
    return this;
  }

  /** Rotate around the x axis to an angle in radians. */
  setRotationX(angle: number): void {
    this.axes[1].set(0, Math.cos(angle), Math.sin(angle));
    this.axes[2].set(0, -Math.sin(angle), Math.cos(angle));
  }

  /** Update the matrices of this object and of all below it. */
  updateMatrixWorld(): void {
    const scales = this.scale.toArray();
    const [x, y, z] = this.axes.map((axis, i) => axis.clone().multiplyScalar(scales[i]));
    const local = new Matrix4().setAxes(x, y, z, this.position);
    if (this.parent) this.matrixWorld.multiplyMatrices(this.parent.matrixWorld, local);
    else this.matrixWorld.copy(local);
    for (const child of this.children) child.updateMatrixWorld();
  }

  getWorldPosition(target: Vector3): Vector3 {
    for (let node: Object3D<any> = this; ; node = node.parent) {
      if (!node.parent) {
        node.updateMatrixWorld();
        return target.fromArray(this.matrixWorld.elements, 12);
      }
    }
  }

  localToWorld(point: Vector3): Vector3 {
    return point.applyMatrix4(this.matrixWorld);
  }

  worldToLocal(point: Vector3): Vector3 {
    return point.applyMatrix4(new Matrix4().copyInverse(this.matrixWorld));
  }

  /** Copy the settings, and clones of the objects below. */
  copy(other: Object3D<any>, isRecursive = true): this {
    const { name, visible, frustumCulled, renderOrder } = other;
    Object.assign(this, { name, visible, frustumCulled, renderOrder });
    this.position.copy(other.position);
    this.scale.copy(other.scale);
    this.axes.forEach((axis, i) => axis.copy(other.axes[i]));
    if (isRecursive) this.add(...other.children.map((child) => child.clone()));
    return this;
  }

  clone(isRecursive = true): this {
    return new (this.constructor as new () => this)().copy(this, isRecursive);
  }
}

export class Group extends Object3D {}

/** The root of what is drawn. */
export class Scene extends Object3D {
  /** Whether only the nearness of surfaces is drawn, from 0 at the far plane to 1 at the near one. */
  isShadow = false;
}

/** A geometry with materials: one, or one per group. */
export class Mesh<
  Geometry extends BufferGeometry<any> = BufferGeometry,
  Materials extends Material | Material[] = Material | Material[],
  Events extends object = Object3DEventMap,
> extends Object3D<Events> {
  readonly type: string = "Mesh";
  /** Kind of primitive, as a constant of WebGL. */
  readonly mode: number = 4; // triangles

  constructor(
    public geometry: Geometry = new BufferGeometry() as Geometry,
    public material: Materials = [] as Material[] as Materials,
  ) {
    super();
  }

  /** Called before it is drawn. */
  onBeforeRender(_renderer: unknown): void {}

  /** Position of a vertex; the positions must be in memory. */
  getVertexPosition(index: number, target: Vector3): Vector3 {
    return target.fromBufferAttribute(this.geometry.attributes.position as BufferAttribute, index);
  }

  /** Append the intersections with a ray; the positions must be in memory. */
  raycast(raycaster: Raycaster, intersects: Intersection[]): void {
    const { index, groups } = this.geometry;
    const corners = index?.array ?? [];
    const parts = groups.length ? groups : [{ start: 0, count: corners.length }];
    const ray = raycaster.inSpaceOf(this.matrixWorld);
    const vertices = [0, 1, 2].map(() => new Vector3());
    for (const { start, count, materialIndex = 0 } of parts) {
      const isDouble = ([this.material].flat()[materialIndex] as Material | undefined)?.side === DoubleSide;
      for (let at = start; at < start + count; at += 3) {
        vertices.forEach((vertex, i) => this.getVertexPosition(corners[at + i], vertex));
        const t = ray.hit(vertices, isDouble);
        if (t === null) continue;
        const point = this.localToWorld(ray.at(t));
        const face = { a: corners[at], b: corners[at + 1], c: corners[at + 2] };
        const distance = raycaster.origin.distanceTo(point);
        intersects.push({ distance, point, face, faceIndex: at / 3, object: this });
      }
    }
  }

  dispose(): void {
    this.dispatchEvent({ type: "dispose" } as never);
  }
}

export class Points<
  Geometry extends BufferGeometry = BufferGeometry,
  Kind extends Material = Material,
> extends Mesh<Geometry, Kind> {
  override readonly mode = 0;
}

export class LineSegments<
  Geometry extends BufferGeometry = BufferGeometry,
  Kind extends Material = Material,
> extends Mesh<Geometry, Kind> {
  override readonly mode = 1;
}

/** A view of the scene along its -z axis. */
export class Camera extends Object3D {
  readonly projectionMatrix = new Matrix4();
  readonly up = new Vector3(0, 1, 0);

  /** Turn to a point. */
  lookAt(target: Vector3): void {
    const [right, up, back] = this.axes;
    back.subVectors(this.position, target).normalize();
    right.crossVectors(this.up, back).normalize();
    up.crossVectors(back, right);
  }
}

export class PerspectiveCamera extends Camera {
  /** Vertical field of view, in degrees. */
  fov = 50;
  aspect = 1;
  near = 0.1;
  far = 2000;

  /** Half the height of the view at distance 1. */
  get slope(): number {
    return Math.tan((this.fov * Math.PI) / 360);
  }

  updateProjectionMatrix(): void {
    const { slope, aspect, near, far } = this;
    this.projectionMatrix.setPerspective(slope * aspect, slope, near, far);
  }
}
