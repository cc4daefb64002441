// The picture: the decoded mesh, the original beside or over it, heat, and how all is shaded.

import * as THREE from "three";

import { outermost } from "./camera";
import { Decoder } from "./gpu/decoder";
import type { VertexGrid } from "./gpu/grid";
import { NormalPass } from "./gpu/normals";
import { HEAT_MAP, OWN_COLORS, Paint, PLAIN } from "./gpu/paint";
import { edgesOf, Surface } from "./gpu/surface";
import type { Background, Stage } from "./stage";

export type Shading = "flat" | "smooth";
export type Arrangement = "decoded" | "beside" | "over";

export interface Look {
  shading: Shading;
  wire: boolean;
  ownColors: boolean;
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
  readonly decoder: Decoder;
  readonly paint: Paint;
  private readonly decoded: Surface;
  private readonly original: Surface | null = null;
  private readonly originalPositions: THREE.DataTexture | null = null;
  private normals: NormalPass | null = null;
  private edgeIndex: THREE.BufferAttribute | null = null;
  private hasHeat = false;
  /** The middle of the decoded mesh as it was drawn. */
  private readonly centre = new THREE.Vector3();

  constructor(
    private readonly stage: Stage,
    private readonly grid: VertexGrid,
    private readonly faceVertices: Uint32Array,
    ownColors: Uint8Array | null,
    hasOriginal: boolean,
    private readonly diagonal: number,
    readonly look: Look,
  ) {
    this.decoder = new Decoder(stage.renderer, grid);
    this.paint = new Paint(grid, ownColors);
    const index = new THREE.BufferAttribute(faceVertices, 1);
    this.decoded = new Surface(this.decoder.target.texture, grid, index, this.paint.uniforms);
    stage.add(this.decoded.group);
    if (hasOriginal) {
      this.originalPositions = grid.floats(4);
      const plain = { ...this.paint.uniforms, paintKind: { value: PLAIN } };
      this.original = new Surface(this.originalPositions, grid, index, plain);
      stage.add(this.original.group);
    }
    this.applyLook();
  }

  /** Takes over the changes in `look`. */
  applyLook(): void {
    const { arrangement, background, wire } = this.look;
    const own = this.paint.hasOwnColors && this.look.ownColors;
    const paintKind = own ? OWN_COLORS : PLAIN;
    this.paint.uniforms.paintKind.value = this.hasHeat ? HEAT_MAP : paintKind;
    const ink = new THREE.Vector4(...INK[background], 0.45);
    this.ruleLines(this.decoded, wire, ink, LIFT.wire);
    const [decoded, original] = [this.decoded.group, this.original?.group];
    if (this.original && original) {
      const isOver = arrangement === "over";
      this.original.faces.visible = !isOver;
      this.original.faces.material.uniforms.paintKind.value = paintKind;
      const over = new THREE.Vector4(...ORIGINAL_INK, 0.4);
      this.ruleLines(
        this.original,
        isOver || wire,
        isOver ? over : ink,
        isOver ? LIFT.over : LIFT.wire,
      );
    }
    if (!original || arrangement === "decoded") this.stage.setViews([[decoded]]);
    else
      this.stage.setViews(arrangement === "over" ? [[decoded, original]] : [[decoded], [original]]);
    this.stage.setBackground(background);
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

  /** Takes over the positions that the decoder has just computed. */
  decodedMoved(): void {
    this.decoded.moved();
  }

  setOriginal(positions: Float32Array): void {
    if (!this.originalPositions) return;
    const data = this.originalPositions.image.data as unknown as Float32Array;
    for (let from = 0, to = 0; from < positions.length; from += 3, to += 4) {
      data[to] = positions[from];
      data[to + 1] = positions[from + 1];
      data[to + 2] = positions[from + 2];
    }
    this.originalPositions.needsUpdate = true;
    this.original?.moved();
  }

  /** Paints the decoded mesh by values, the hottest of which is given; null: no heat map. */
  setHeat(heat: { values: Float32Array; hottest: number } | null): void {
    const had = this.hasHeat;
    this.hasHeat = heat !== null;
    if (heat) this.paint.setHeat(heat.values, heat.hottest);
    if (had !== this.hasHeat) this.applyLook();
  }

  /** Draws all, where `centre` is the middle of the decoded mesh. */
  draw(centre: THREE.Vector3): void {
    this.centre.copy(centre);
    this.stage.follow(this.look.isFollowed ? centre : null);
    const isSmooth = this.look.shading === "smooth";
    if (isSmooth) this.normals ??= new NormalPass(this.grid, this.faceVertices);
    this.decoded.shade(this.stage.renderer, isSmooth ? this.normals : null);
    if (this.needsOriginal)
      this.original?.shade(this.stage.renderer, isSmooth ? this.normals : null);
    this.stage.draw();
  }

  private ruleLines(surface: Surface, visible: boolean, ink: THREE.Vector4, lift: number): void {
    surface.lines.visible = visible;
    surface.lines.material.uniforms.ink.value = ink;
    surface.lines.material.uniforms.lift.value = lift * this.diagonal;
    if (visible && !surface.lines.geometry.index) surface.lines.geometry.setIndex(this.edges());
  }

  /** The outermost points of the shown frame about its middle, with room around. */
  private pose(): THREE.Vector3[] {
    const points = outermost(this.decoder.read());
    return points.map((point) => point.sub(this.centre).multiplyScalar(ROOM));
  }

  private edges(): THREE.BufferAttribute {
    this.edgeIndex ??= new THREE.BufferAttribute(edgesOf(this.faceVertices, this.grid.nVerts), 1);
    return this.edgeIndex;
  }
}
