// Intersections of rays with triangles.

import { Matrix4, Vector3 } from "./math.js";

/** Where a ray meets an object. */
export interface Intersection {
  readonly distance: number;
  readonly point: Vector3;
  readonly object: object;
  readonly face?: { readonly a: number; readonly b: number; readonly c: number } | null;
  readonly faceIndex?: number | null;
}

/** What a ray of a camera depends on. */
interface View {
  readonly position: Vector3;
  readonly axes: readonly [right: Vector3, up: Vector3, back: Vector3];
  /** Half the height of the view at distance 1. */
  readonly slope: number;
  readonly aspect: number;
}

/** A ray from `origin`, whose direction need not have length 1. */
export class Raycaster {
  constructor(
    readonly origin: Vector3,
    readonly direction: Vector3,
  ) {}

  /** Create the ray of a camera through a point of its view, whose sides are at -1 and 1. */
  static fromCamera(x: number, y: number, { slope, aspect, position, axes }: View): Raycaster {
    const [right, up, back] = axes;
    const direction = right.clone().multiplyScalar(x * slope * aspect).addScaledVector(up, y * slope);
    return new Raycaster(position.clone(), direction.sub(back));
  }

  /** Return the intersections with an object, the closest first. */
  intersectObject(object: { raycast(ray: Raycaster, intersects: Intersection[]): void }): Intersection[] {
    const intersections: Intersection[] = [];
    object.raycast(this, intersections);
    return intersections.sort((a, b) => a.distance - b.distance);
  }

  /** Return the ray in the space of an object. */
  inSpaceOf(matrixWorld: Matrix4): Raycaster {
    const inverse = new Matrix4().copyInverse(matrixWorld);
    const end = this.at(1).applyMatrix4(inverse);
    const origin = this.origin.clone().applyMatrix4(inverse);
    return new Raycaster(origin, end.sub(origin));
  }

  at(t: number): Vector3 {
    return this.origin.clone().addScaledVector(this.direction, t);
  }

  /** Return `t` of the intersection with a triangle; null without one, or from behind unless `isDouble`. */
  hit([a, b, c]: readonly Vector3[], isDouble: boolean): number | null {
    const [ab, ac] = [b.clone().sub(a), c.clone().sub(a)];
    const p = new Vector3().crossVectors(this.direction, ac);
    const det = ab.dot(p); // positive if the front faces the origin of the ray
    if (!(isDouble ? det : det > 0)) return null;
    const from = this.origin.clone().sub(a);
    const u = from.dot(p) / det;
    const q = from.cross(ab);
    const v = this.direction.dot(q) / det;
    const t = ac.dot(q) / det;
    return u >= 0 && v >= 0 && u + v <= 1 && t >= 0 ? t : null;
  }
}
