// The original as a three.js mesh that shows one frame at a time.

import { BufferAttribute, BufferGeometry, DynamicDrawUsage, Mesh, Vector3 } from "../../webgl/index.js";

import type { ColorAttribute } from "../../three/color/track_colors.js";
import type { ReelMesh } from "../../three/reel_mesh.js";

/** A mesh that shares faces, UVs and colors with the decoded mesh, but has its own positions. */
export class OriginalMesh extends Mesh {
  private sources!: Uint32Array;
  private positions!: BufferAttribute;
  private normals!: BufferAttribute;
  /** Positions of the current frame, of shape (V, 3). */
  private current: Float32Array | null = null;
  private colors: BufferAttribute | null = null;
  private areNormalsStale = true;

  constructor(private readonly decoded: ReelMesh) {
    super();
    this.rebuildGeometry();
  }

  /** Rebuild the geometry after that of the decoded mesh has changed. */
  rebuildGeometry(): void {
    this.releaseGeometry();
    this.geometry = new BufferGeometry();
    const { index, groups, attributes } = this.decoded.geometry;
    Object.assign(this.geometry, { index, groups, attributes: { ...attributes } });
    this.sources = this.decoded.sources;
    this.colors = null;
    const created = (name: string) =>
      this.attribute(name, 3, new Float32Array(3 * this.sources.length));
    [this.positions, this.normals] = [created("position"), created("normal")];
    if (this.current) this.setPositions(this.current);
  }

  /** Set the positions (V, 3) of a frame. */
  setPositions(positions: Float32Array): void {
    this.current = positions;
    scatter(positions, this.sources, this.positions);
    this.areNormalsStale = true;
  }

  /** Set the colors of a frame. */
  setColors({ name, width, values }: ColorAttribute): void {
    this.colors ??= this.attribute(name, width, values);
    this.colors.array.set(values);
    this.colors.needsUpdate = true;
  }

  /** Compute normals from the positions, for smooth shading. */
  computeNormals(): void {
    if (!this.areNormalsStale) return;
    this.areNormalsStale = false;
    const { triangles } = this.decoded.reel.surface;
    const places = this.geometry.index?.array as Uint32Array;
    const sums = new Float32Array(3 * this.decoded.reel.info.nVerts);
    const corners = [0, 1, 2].map(() => new Vector3());
    const [ab, ac] = [new Vector3(), new Vector3()];
    for (let i = 0; i < triangles.length; i += 3) {
      const vertices = [0, 1, 2].map((corner) => places[i + corner]);
      vertices.forEach((at, corner) => corners[corner].fromBufferAttribute(this.positions, at));
      ab.subVectors(corners[1], corners[0]);
      ab.cross(ac.subVectors(corners[2], corners[0]));
      for (const at of vertices) {
        const source = 3 * this.sources[at];
        sums[source] += ab.x;
        sums[source + 1] += ab.y;
        sums[source + 2] += ab.z;
      }
    }
    for (let at = 0; at < sums.length; at += 3) {
      const size = Math.hypot(sums[at], sums[at + 1], sums[at + 2]) || 1;
      for (let axis = 0; axis < 3; axis++) sums[at + axis] /= size;
    }
    scatter(sums, this.sources, this.normals);
  }

  /** Free the attributes that only this mesh uses. */
  private releaseGeometry(): void {
    const own = Object.entries(this.geometry.attributes).filter(([, attribute]) =>
      [this.positions, this.normals, this.colors].includes(attribute as BufferAttribute),
    );
    Object.assign(this.geometry, { index: null, attributes: Object.fromEntries(own) });
    this.geometry.dispose();
  }

  private attribute(name: string, width: number, values: Float32Array): BufferAttribute {
    const created = new BufferAttribute(values, width).setUsage(DynamicDrawUsage);
    this.geometry.setAttribute(name, created);
    return created;
  }
}

/** Copy three numbers of each source vertex to the vertices of the geometry. */
function scatter(from: Float32Array, sources: Uint32Array, into: BufferAttribute): void {
  const values = into.array as Float32Array;
  for (let i = 0; i < values.length; i++) values[i] = from[3 * sources[Math.floor(i / 3)] + (i % 3)];
  into.needsUpdate = true;
}
