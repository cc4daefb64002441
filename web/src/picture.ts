// The picture: the decoded mesh, the original beside or over it, heat, and how all is shaded.

import { ReelMesh } from "meshreel/three";
import * as THREE from "three";

import { outermost } from "./camera";
import { edgesOf } from "./edges";
import type { Reel } from "./facts";
import { Figure } from "./shading/figure";
import { OriginalMesh } from "./shading/original";
import type { Background, Stage } from "./stage";

export type Shading = "flat" | "smooth";
export type Arrangement = "decoded" | "beside" | "over";

export interface Look {
  shading: Shading;
  wire: boolean;
  /** Colours and materials of the file, where it has some. */
  ownLook: boolean;
  background: Background;
  arrangement: Arrangement;
  /** The mesh is kept in the middle, wherever it goes. */
  isFollowed: boolean;
}

/** Around the pose of the shown frame, so that others fit as well. */
const ROOM = 1.25;

/** A mesh that the camera comes so much nearer to when it follows it is followed from the start. */
const NEARER = 1.15;

const INK: Record<Background, [number, number, number]> = {
  light: [0.08, 0.1, 0.14],
  dark: [0.02, 0.02, 0.03],
  none: [0.08, 0.1, 0.14],
};
/**
 * How much nearer than they are lines are drawn, as shares of the diagonal: edges of the mesh that is
 * drawn, and those of the original, which is off by the errors of the other.
 */
const LIFT = { wire: 0.001, over: 0.02 };
const ORIGINAL_INK: [number, number, number] = [0.93, 0.42, 0.1];

export class Picture {
  readonly mesh: ReelMesh;
  /** Whether the file says how its faces look. */
  readonly hasOwnLook: boolean;
  private readonly decoded: Figure;
  private readonly original: { mesh: OriginalMesh; figure: Figure } | null = null;
  private readonly heat: THREE.BufferAttribute;
  private edgeIndex: THREE.BufferAttribute | null = null;
  private hasHeat = false;

  constructor(
    private readonly stage: Stage,
    private readonly reel: Reel,
    readonly look: Look,
    hasTexture: boolean,
  ) {
    const { file } = reel;
    const { renderer } = stage;
    this.mesh = new ReelMesh(file, { renderer, origin: file.info.center });
    const { geometry, material, sources } = this.mesh;
    const { materials } = file.surface;
    this.hasOwnLook = hasTexture || "color" in geometry.attributes || materials.length > 0;
    this.heat = new THREE.BufferAttribute(new Float32Array(sources.length), 1);
    geometry.setAttribute("heat", this.heat.setUsage(THREE.DynamicDrawUsage));
    this.decoded = new Figure(this.mesh, material);
    stage.add(this.decoded.group);
    if (reel.original) {
      const mesh = new OriginalMesh(this.mesh);
      this.original = { mesh, figure: new Figure(mesh, material) };
      stage.add(this.original.figure.group);
    }
    this.applyLook();
  }

  /** Takes over the changes in `look`. */
  applyLook(): void {
    const { arrangement, background, wire, shading } = this.look;
    const isOwn = this.hasOwnLook && this.look.ownLook;
    const isSmooth = shading === "smooth";
    const ink = [...INK[background], 0.45] as const;
    this.decoded.dress(isOwn && !this.hasHeat, isSmooth);
    this.rule(this.decoded, wire, ink, LIFT.wire);
    const { stage, decoded, original } = this;
    if (original) {
      const isOver = arrangement === "over";
      original.mesh.visible = !isOver;
      original.figure.dress(isOwn, isSmooth);
      if (isOver) this.rule(original.figure, true, [...ORIGINAL_INK, 0.4], LIFT.over);
      else this.rule(original.figure, wire, ink, LIFT.wire);
    }
    if (!original || arrangement === "decoded") stage.setViews([[decoded.group]]);
    else if (arrangement === "over") stage.setViews([[decoded.group, original.figure.group]]);
    else stage.setViews([[decoded.group], [original.figure.group]]);
    stage.setBackground(background);
  }

  get needsOriginal(): boolean {
    return this.original !== null && this.look.arrangement !== "decoded";
  }

  /** Turns following on or off, and frames the shown frame, or all that the mesh sweeps. */
  setFollowed(isFollowed: boolean): void {
    this.look.isFollowed = isFollowed;
    this.stage.frame(isFollowed ? this.pose() : null);
  }

  /** Whether the shown frame is small beside all that the mesh sweeps. */
  travelsFar(): boolean {
    return this.stage.distanceTo(null) > NEARER * this.stage.distanceTo(this.pose());
  }

  setOriginal(positions: Float32Array): void {
    this.original?.mesh.setPositions(positions);
  }

  /** Paints the decoded mesh by values, the hottest of which is given; null: no heat map. */
  setHeat(heat: { values: Float32Array; hottest: number } | null): void {
    const had = this.hasHeat;
    this.hasHeat = heat !== null;
    this.decoded.faces.hottest = heat?.hottest ?? null;
    if (heat) this.paint(heat.values);
    if (had !== this.hasHeat) this.applyLook();
  }

  /** Positions (V, 3) as they are drawn, from the centre of the file; read back from the GPU. */
  positions(): Float32Array {
    const positions = new Float32Array(3 * this.reel.file.info.nVerts);
    const point = new THREE.Vector3();
    this.mesh.sources.forEach((source, vertex) => {
      this.mesh.getVertexPosition(vertex, point).toArray(positions, 3 * source);
    });
    return positions;
  }

  /** Values at each vertex by which it is painted; null where it is not. */
  heatValues(): Float32Array | null {
    if (!this.hasHeat) return null;
    const values = new Float32Array(this.reel.file.info.nVerts);
    this.mesh.sources.forEach((source, vertex) => (values[source] = this.heat.array[vertex]));
    return values;
  }

  /** Draws all. */
  draw(): void {
    const { original } = this;
    this.stage.follow(this.look.isFollowed ? this.middle() : null);
    this.decoded.join();
    if (original && this.needsOriginal) {
      if (this.look.shading === "smooth") original.mesh.bend();
      original.figure.join();
    }
    this.stage.draw();
  }

  private middle(): THREE.Vector3 {
    return this.mesh.getMiddle(new THREE.Vector3());
  }

  private paint(values: Float32Array): void {
    const painted = this.heat.array as Float32Array;
    this.mesh.sources.forEach((source, vertex) => {
      painted[vertex] = Number.isNaN(values[source]) ? -1 : values[source];
    });
    this.heat.needsUpdate = true;
  }

  private rule(
    { lines }: Figure,
    isVisible: boolean,
    ink: readonly [number, number, number, number],
    lift: number,
  ): void {
    lines.visible = isVisible;
    lines.rule(ink, lift * this.reel.file.info.diagonal);
    if (isVisible && !lines.geometry.index) lines.geometry.setIndex(this.edges());
  }

  /** The outermost points of the shown frame about its middle, with room around. */
  private pose(): THREE.Vector3[] {
    const middle = this.middle();
    return outermost(this.positions()).map((point) => point.sub(middle).multiplyScalar(ROOM));
  }

  private edges(): THREE.BufferAttribute {
    const { index } = this.mesh.geometry;
    this.edgeIndex ??= new THREE.BufferAttribute(
      edgesOf(index?.array as Uint32Array, this.mesh.sources.length),
      1,
    );
    return this.edgeIndex;
  }
}
