// The original as a three.js mesh that shows one frame at a time.

import { BufferAttribute, BufferGeometry, DynamicDrawUsage, Mesh } from "../../webgl/index.js";

import { computeNormals, gather } from "../../three/cpu_frames.js";
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
    this.update(this.positions, positions);
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
    if (!this.areNormalsStale || !this.current) return;
    this.areNormalsStale = false;
    const normals = new Float32Array(this.current.length);
    this.update(this.normals, computeNormals(this.current, this.decoded.surface.triangles, normals));
  }

  /** Set an attribute to three numbers of each vertex of the file. */
  private update(attribute: BufferAttribute, values: Float32Array): void {
    gather(values, this.sources, attribute.array as Float32Array);
    attribute.needsUpdate = true;
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
