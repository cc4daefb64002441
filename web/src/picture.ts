// The picture: the decoded mesh, the original beside or over it, heat, and how all is shaded.

import type { TrackValues } from "meshreel";
import { type ColorLegend, ReelMesh } from "meshreel/three";
import * as THREE from "three";

import { outermost } from "./camera";
import { edgesOf } from "./edges";
import type { Reel } from "./facts";
import { Figure } from "./shading/figure";
import { OriginalMesh } from "./shading/original";
import type { Background, Stage } from "./stage";
import { componentOf, type TrackLook, USUAL_RANGE } from "./tracks/look";
import { type Picked, pickedBy } from "./tracks/pick";

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
const MARKER: [number, number, number] = [1, 0.1, 0.6];

export class Picture {
  readonly mesh: ReelMesh;
  /** Whether the file says how its faces look. */
  readonly hasOwnLook: boolean;
  private readonly decoded: Figure;
  private readonly original: { mesh: OriginalMesh; figure: Figure } | null = null;
  private heat: THREE.BufferAttribute;
  private hasHeat = false;
  private isTracked = false;
  /** Whether the original has the colours of the track. */
  private isOriginalTracked = false;
  private readonly marker = new THREE.Points(
    new THREE.BufferGeometry().setFromPoints([new THREE.Vector3()]),
    new THREE.PointsMaterial({ size: 11, sizeAttenuation: false, depthTest: false }),
  );
  private marked: number | null = null;

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
    this.marker.frustumCulled = false;
    this.marker.renderOrder = 2;
    this.marker.visible = false;
    this.marker.material.color.setRGB(...MARKER);
    this.decoded.group.add(this.marker);
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
    const own = isOwn ? "own" : "plain";
    this.decoded.dress(this.hasHeat ? "plain" : this.isTracked ? "track" : own, isSmooth);
    this.rule(this.decoded, this.mesh, wire, ink, LIFT.wire);
    const { stage, decoded, original } = this;
    if (original) {
      const isOver = arrangement === "over";
      original.mesh.visible = !isOver;
      original.figure.dress(this.isOriginalTracked ? "track" : own, isSmooth);
      if (isOver) {
        this.rule(original.figure, original.mesh, true, [...ORIGINAL_INK, 0.4], LIFT.over);
      } else this.rule(original.figure, original.mesh, wire, ink, LIFT.wire);
    }
    if (!original || arrangement === "decoded") stage.setViews([[decoded.group]]);
    else if (arrangement === "over") stage.setViews([[decoded.group, original.figure.group]]);
    else stage.setViews([[decoded.group], [original.figure.group]]);
    stage.setBackground(background);
  }

  get needsOriginal(): boolean {
    return this.original !== null && this.look.arrangement !== "decoded";
  }

  /** Whether faces of the original are seen. */
  get showsOriginal(): boolean {
    return this.original !== null && this.look.arrangement === "beside";
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

  /** Colours the original by values of a frame of the track that colours the mesh. */
  setOriginalValues(values: TrackValues): void {
    const { original, decoded, mesh } = this;
    if (!original) return;
    original.mesh.setColors(mesh.colorAttribute(values));
    if (this.isOriginalTracked) return;
    this.isOriginalTracked = true;
    original.figure.track.takeColors(decoded.track);
    this.applyLook();
  }

  /** Paints the decoded mesh by values, the hottest of which is given; null: no heat map. */
  setHeat(heat: { values: Float32Array; hottest: number } | null): void {
    const had = this.hasHeat;
    this.hasHeat = heat !== null;
    this.decoded.faces.hottest = heat?.hottest ?? null;
    if (heat) this.paint(heat.values);
    if (had !== this.hasHeat) this.applyLook();
  }

  /**
   * Shows a track in colours in place of the look of the file; null: none. The last call counts: one
   * that is under way throws an `AbortError`.
   */
  async setTrack(look: TrackLook | null): Promise<ColorLegend | null> {
    this.isOriginalTracked = false;
    if (!look) {
      this.isTracked = false;
      await this.mesh.colorBy(null);
      this.refit();
      this.applyLook();
      return null;
    }
    const { track, component, range, colormap } = look;
    const { kind } = this.reel.file.track(track).info;
    const isColor = kind === "color" && (component ?? "color") === "color";
    const usual = kind === "normal" ? undefined : USUAL_RANGE;
    this.isTracked = true;
    this.applyLook(); // colours dress the material that the mesh wears
    const legend = await this.mesh.colorBy(track, {
      component: component === null || isColor ? undefined : componentOf(component),
      ...(isColor ? {} : { range: range ?? usual, wholeFile: true }),
      ...(colormap ? { map: colormap } : {}),
    });
    this.refit();
    return legend;
  }

  /** What of the mesh lies at a place of the page; null: nothing. */
  picked(clientX: number, clientY: number): Picked | null {
    const ray = this.stage.rayAt(clientX, clientY);
    return ray && pickedBy(ray, this.mesh);
  }

  /** Marks a vertex of the file while nothing plays; null: none. */
  mark(vertex: number | null): void {
    this.marked = vertex === null ? null : this.mesh.sources.indexOf(vertex);
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
    this.marker.visible = this.marked !== null && !this.mesh.isPlaying;
    if (this.marker.visible) {
      this.mesh.getVertexPosition(this.marked as number, this.marker.position);
    }
    if (original && this.needsOriginal) {
      if (this.look.shading === "smooth") original.mesh.bend();
      original.figure.join();
    }
    this.stage.draw();
  }

  /** Has heat and lines fit the geometry, whose vertices a track may have split. */
  private refit(): void {
    const { geometry, sources } = this.mesh;
    this.original?.mesh.refit();
    if (geometry.getAttribute("heat") === this.heat) return;
    const vertex = this.marked;
    this.heat = new THREE.BufferAttribute(new Float32Array(sources.length), 1);
    geometry.setAttribute("heat", this.heat.setUsage(THREE.DynamicDrawUsage));
    for (const figure of [this.decoded, this.original?.figure]) figure?.lines.geometry.setIndex(null);
    if (vertex !== null) this.marked = null;
    this.applyLook();
  }

  private middle(): THREE.Vector3 {
    return this.mesh.getCentroid(new THREE.Vector3());
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
    { geometry }: THREE.Mesh,
    isVisible: boolean,
    ink: readonly [number, number, number, number],
    lift: number,
  ): void {
    lines.visible = isVisible;
    lines.rule(ink, lift * this.reel.file.info.diagonal);
    if (!isVisible || lines.geometry.index) return;
    const nVerts = geometry.getAttribute("position").count;
    const edges = edgesOf(geometry.index?.array as Uint32Array, nVerts);
    lines.geometry.setIndex(new THREE.BufferAttribute(edges, 1));
  }

  /** The outermost points of the shown frame about its middle, with room around. */
  private pose(): THREE.Vector3[] {
    const middle = this.middle();
    return outermost(this.positions()).map((point) => point.sub(middle).multiplyScalar(ROOM));
  }
}
