// The contents of the views: the decoded mesh, the original, heat maps and shading.

import type { CutPlane, TrackValues } from "../index.js";
import type { PlayerParts } from "../player/element.js";
import { parseComponent } from "../player/settings.js";
import type { View } from "../player/view.js";
import type { ColorLegend } from "../three/color/track_colors.js";
import type { ReelMesh } from "../three/reel_mesh.js";
import { BufferAttribute, DynamicDrawUsage, Mesh, Vector3 } from "../webgl/index.js";

import { uniqueEdges } from "./edges.js";
import type { Reel, TrackSettings } from "./facts.js";
import { colorUv } from "../three/color/color_map.js";
import { HEAT_ATTRIBUTE } from "./shading/faces.js";
import { Marker } from "./shading/marker.js";
import { MeshView } from "./shading/mesh_view.js";
import { OriginalMesh } from "./shading/original.js";
import { type Picked, pickFirst } from "./tracks/pick.js";

export type Background = "light" | "dark" | "none";
export type Shading = "flat" | "smooth";
export type Arrangement = "decoded" | "beside" | "over";

export interface Look {
  shading: Shading;
  wire: boolean;
  /** Whether to show colors and materials of the file. */
  usesFileMaterials: boolean;
  background: Background;
  arrangement: Arrangement;
}

const INK: Record<Background, [number, number, number]> = {
  light: [0.08, 0.1, 0.14],
  dark: [0.02, 0.02, 0.03],
  none: [0.08, 0.1, 0.14],
};
/**
 * Offset of lines towards the camera, as fractions of the diagonal: for edges of the same mesh, and for
 * edges of the original over the decoded mesh, which differ by the coding error.
 */
const LINE_LIFT = { wire: 0.001, over: 0.02 };
const ORIGINAL_INK: [number, number, number] = [0.93, 0.42, 0.1];

export class Picture {
  private readonly view: View;
  /** Whether the file has colors or materials, or a texture is shown. */
  readonly hasFileMaterials: boolean;
  private readonly decoded: MeshView;
  private readonly original: { mesh: OriginalMesh; figure: MeshView } | null = null;
  /** UVs of the heat map. */
  private heatUvs!: BufferAttribute;
  private heat: { values: Float32Array; heatMaximum: number } | null = null;
  private hasTrackColors = false;
  /** Whether the original is colored by the track. */
  private hasOriginalTrackColors = false;
  private readonly marker = new Marker();
  private markedVertex: number | null = null;

  constructor(
    parts: PlayerParts,
    readonly mesh: ReelMesh,
    private readonly reel: Reel,
    readonly look: Look,
    hasTexture: boolean,
  ) {
    this.view = parts.view;
    this.mesh.addEventListener("segment", () => {
      this.decoded.setFileMaterials(this.mesh.segmentMaterial);
      this.rebuildAttributes();
    });
    const { geometry, material } = this.mesh;
    const { materials } = reel.file.surface;
    this.hasFileMaterials = hasTexture || "color" in geometry.attributes || materials.length > 0;
    this.createHeatUvs();
    this.decoded = new MeshView(this.mesh, material);
    this.decoded.group.add(this.marker);
    this.view.model.add(this.decoded.group);
    if (reel.original) {
      const mesh = new OriginalMesh(this.mesh);
      this.original = { mesh, figure: new MeshView(mesh, material) };
      this.view.model.add(this.original.figure.group);
    }
    this.applyLook();
  }

  /** Apply changes of `look`. */
  applyLook(): void {
    const { view, decoded, original } = this;
    const { arrangement } = this.look;
    this.applyAppearance();
    if (!original || arrangement === "decoded") view.setPanes([[decoded.group]]);
    else if (arrangement === "over") view.setPanes([[decoded.group, original.figure.group]]);
    else view.setPanes([[decoded.group], [original.figure.group]]);
  }

  /** Set the materials and lines of the meshes. */
  private applyAppearance(): void {
    const { arrangement, background, wire, shading } = this.look;
    const usesOwn = !this.hasFileMaterials || this.look.usesFileMaterials;
    const isSmooth = shading === "smooth";
    const ink = [...INK[background], 0.45] as const;
    const own = usesOwn ? "own" : "plain";
    this.decoded.setAppearance(this.heat ? "plain" : this.hasTrackColors ? "track" : own, isSmooth);
    this.setLines(this.decoded, this.mesh, wire, ink, LINE_LIFT.wire);
    const { original } = this;
    if (original) {
      const isOver = arrangement === "over";
      original.mesh.visible = !isOver;
      original.figure.setAppearance(this.hasOriginalTrackColors ? "track" : own, isSmooth);
      if (isOver) {
        this.setLines(original.figure, original.mesh, true, [...ORIGINAL_INK, 0.4], LINE_LIFT.over);
      } else this.setLines(original.figure, original.mesh, wire, ink, LINE_LIFT.wire);
    }
  }

  get needsOriginal(): boolean {
    return this.original !== null && this.look.arrangement !== "decoded";
  }

  /** Whether faces of the original are visible. */
  get showsOriginal(): boolean {
    return this.original !== null && this.look.arrangement === "beside";
  }

  setOriginal(positions: Float32Array): void {
    this.original?.mesh.setPositions(positions);
  }

  /** Color the original by values of the track that colors the mesh. */
  setOriginalValues(values: TrackValues): void {
    const { original, decoded, mesh } = this;
    if (!original) return;
    original.mesh.setColors(mesh.colorAttribute(values));
    if (this.hasOriginalTrackColors) return;
    this.hasOriginalTrackColors = true;
    original.figure.track.copyColors(decoded.track);
    this.applyLook();
  }

  /** Show a heat map on the decoded mesh; null: none. */
  setHeat(heat: { values: Float32Array; heatMaximum: number } | null): void {
    const hadHeat = this.heat !== null;
    this.heat = heat;
    if (heat) {
      const uvs = this.heatUvs.array;
      this.mesh.sources.forEach((source, vertex) => {
        uvs.set(colorUv(heat.values[source] / (heat.heatMaximum || 1)), 2 * vertex);
      });
      this.heatUvs.needsUpdate = true;
    }
    if (hadHeat === (heat !== null)) return;
    this.decoded.faces.hasHeat = heat !== null;
    this.applyLook();
  }

  /**
   * Color the mesh by a track in place of the materials of the file; null: none. A new call cancels a
   * pending one, which throws an `AbortError`.
   */
  async setTrack(look: TrackSettings | null): Promise<ColorLegend | null> {
    this.hasOriginalTrackColors = false;
    if (!look) {
      this.hasTrackColors = false;
      await this.mesh.colorBy(null);
      this.rebuildAttributes();
      this.applyLook();
      return null;
    }
    const { track, component, range, colormap } = look;
    const isColor = this.reel.file.track(track).info.kind === "color" && (component ?? "color") === "color";
    this.hasTrackColors = true;
    this.applyLook(); // `colorBy` applies to the current material
    const legend = await this.mesh.colorBy(track, {
      component: parseComponent(isColor ? null : component),
      ...(isColor ? {} : { range: range ?? undefined, wholeFile: true }),
      ...(colormap ? { map: colormap } : {}),
    });
    this.rebuildAttributes();
    return legend;
  }

  /** Hide the cells beyond a plane; null: none. */
  async cut(plane: CutPlane | null): Promise<void> {
    await this.mesh.cut(plane);
    this.rebuildAttributes();
  }

  /** Return the vertex, face and corner at a position on the page; null outside of the mesh. */
  pickAt(clientX: number, clientY: number): Picked | null {
    const ray = this.view.rayAt(clientX, clientY);
    return ray && pickFirst(ray, this.mesh);
  }

  /** Mark a vertex of the file while playback is paused; null: none. */
  setMarker(vertex: number | null): void {
    this.markedVertex = vertex === null ? null : this.mesh.sources.indexOf(vertex);
  }

  /** Read the drawn positions (V, 3) back from the GPU, relative to the center of the file. */
  positions(): Float32Array {
    const positions = new Float32Array(3 * this.mesh.reel.info.nVerts);
    const point = new Vector3();
    this.mesh.sources.forEach((source, vertex) => {
      this.mesh.getVertexPosition(vertex, point).toArray(positions, 3 * source);
    });
    return positions;
  }

  /** Return the heat map values of the vertices; null without a heat map. */
  heatValues(): Float32Array | null {
    return this.heat && this.heat.values;
  }

  /** Prepare the next drawing. */
  prepare(): void {
    const { original } = this;
    this.decoded.syncPositions();
    this.marker.visible = this.markedVertex !== null && !this.mesh.isPlaying;
    if (this.marker.visible) {
      this.mesh.getVertexPosition(this.markedVertex as number, this.marker.position);
      this.marker.setPixelRatio(this.view.renderer?.getPixelRatio() ?? 1);
    }
    if (original && this.needsOriginal) {
      if (this.look.shading === "smooth") original.mesh.computeNormals();
      original.figure.syncPositions();
    }
  }

  /** Rebuild attributes and lines for the current geometry, whose vertices a track may have split. */
  private rebuildAttributes(): void {
    const { geometry } = this.mesh;
    this.original?.mesh.rebuildGeometry();
    if (geometry.getAttribute(HEAT_ATTRIBUTE) === this.heatUvs) return;
    this.createHeatUvs();
    for (const figure of [this.decoded, this.original?.figure]) figure?.lines.geometry.setIndex(null);
    this.markedVertex = null;
    this.applyAppearance();
  }

  private createHeatUvs(): void {
    const { geometry, sources } = this.mesh;
    this.heatUvs = new BufferAttribute(new Float32Array(2 * sources.length), 2).setUsage(DynamicDrawUsage);
    geometry.setAttribute(HEAT_ATTRIBUTE, this.heatUvs);
  }

  private setLines(
    { lines }: MeshView,
    { geometry }: Mesh,
    isVisible: boolean,
    ink: readonly [number, number, number, number],
    lift: number,
  ): void {
    lines.visible = isVisible;
    lines.setStyle(ink, lift * this.reel.file.info.diagonal);
    if (!isVisible || lines.geometry.index) return;
    const nVerts = geometry.getAttribute("position").count;
    const edges = uniqueEdges(geometry.index?.array as Uint32Array, nVerts);
    lines.geometry.setIndex(new BufferAttribute(edges, 1));
  }
}
