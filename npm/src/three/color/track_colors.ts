// Colors a mesh by a track. Loaded with the first `colorBy`.

import * as THREE from "three";

import { InvalidInputError } from "../../errors.js";
import { KIND_ROWS } from "../../track_kinds.js";
import type {
  BlockFields,
  BlockInfo,
  OpenSegments,
  OpenTrack,
  TrackFields,
  TrackValues,
} from "../../types.js";
import type { Split } from "../corners.js";
import { type Drawing, MAX_UV_SETS } from "../drawing.js";
import { srgbToLinear } from "../drawn_vertices.js";
import { composePicture, type LoadedBlock, type Moment, withoutFields } from "../loaded_block.js";
import type { PlaybackEvent } from "../playback.js";
import type { AttributeBackend, Backend } from "../backend.js";
import { hasMap, overrideMaterial } from "../material_override.js";
import {
  centerAtZero,
  colorAt,
  type ColorMap,
  type Colors,
  colorUv,
  resolveColorMap,
  MISSING_UV,
  U_OFFSET,
  V_ROW,
  U_SCALE,
  createColorTexture,
} from "./color_map.js";
import {
  type Component,
  DEFAULT_RANGE,
  parseRange,
  type Selection,
  selectColumns,
  resolveRange,
} from "./color_range.js";

/** Magnitudes of at least this mark missing values; valid ones are normalized to about 1. */
const MISSING_THRESHOLD = 1e35;

/** Marks missing values; large enough to stay above the threshold after interpolation. */
const MISSING_VALUE = 3e38;

/** Options of `ReelMesh.colorBy`. */
export interface ColorOptions {
  /**
   * Color map. Default: "diverging" if the range contains 0, else "sequential".
   */
  map?: ColorMap;
  /**
   * Values at the ends of the map; values outside are clamped. Two numbers, or a string such as
   * "0:500" or "2%:98%". Percentiles are estimated from eight frames of the first block. If two
   * percentiles have opposite signs, the range is symmetric about 0; one that passes 0 by no more
   * than the error bound of the track becomes 0. Default: "2%:98%"; for normals [-1, 1].
   */
  range?: readonly [number, number] | string;
  /**
   * Whether to estimate percentiles from eight frames of the whole file (from all frames for 0% and
   * 100%), which downloads their blocks. Default: false.
   */
  wholeFile?: boolean;
  /**
   * Component to show: a column index; "x", "y" or "z" if there are up to three columns; or their
   * length, "magnitude". Default: the only column; the color of a color track; "x" of normals; else
   * the magnitude.
   */
  component?: Component;
}

/** The meaning of the colors, for a legend. */
export interface ColorLegend {
  readonly name: string;
  /** Unit, such as "Pa"; empty if unknown. */
  readonly unit: string;
  /** Range of the color map; null if the track consists of colors. */
  readonly range: readonly [number, number] | null;
  readonly component: number | "magnitude" | "color";
  /** Return the color of a value: red, green and blue, 0..255; gray for NaN. */
  colorOf(value: number): [number, number, number];
}

/** An attribute of a geometry that encodes values of a track as colors. */
export interface ColorAttribute {
  /** "color", or UVs into the color map such as "uv1". */
  readonly name: string;
  /** Numbers per vertex. */
  readonly width: 2 | 3;
  readonly values: Float32Array;
}

/** The mesh to color. */
export interface ColoredMesh {
  readonly file: OpenSegments;
  readonly drawing: Drawing;
  readonly material: THREE.Material | THREE.Material[];
  readonly send: (event: PlaybackEvent) => void;
}

/** Options that apply only to numbers. */
const NUMBER_OPTIONS = ["range", "map", "wholeFile"] as const;

/** The attribute of a vertex that encodes a value. */
interface EncodedColor {
  readonly name: string;
  readonly width: 2 | 3;
  /** GLSL that sets the attribute from `value`, a vec3; must match `evaluate`. */
  readonly glsl: string;
  evaluate(values: Float32Array, from: number): readonly number[];
}

/** Gray of missing colors, linear. */
const MISSING_INTENSITY = 0.2158;

/** Colors a mesh by a track from `attach` until `dispose`. */
export class TrackColors {
  readonly legend: ColorLegend;
  readonly #track: OpenTrack;
  readonly #selection: Selection;
  readonly #range: readonly [number, number];
  readonly #mesh: ColoredMesh;
  readonly #channel: number;
  readonly #materials: readonly THREE.Material[];
  readonly #texture: THREE.DataTexture;
  /** Functions that restore the materials. */
  readonly #restore: (() => void)[] = [];
  /** Loaded blocks of the track, by the block of the mesh. */
  readonly #colorBlocks = new Map<LoadedBlock, LoadedBlock>();
  #backend: AttributeBackend | null = null;
  /** Restores the geometry. */
  #detach = (): void => {};

  private constructor(
    track: OpenTrack,
    selection: Selection,
    range: [number, number],
    colors: Colors,
    mesh: ColoredMesh,
  ) {
    this.#track = track;
    this.#selection = selection;
    this.#range = range;
    this.#mesh = mesh;
    this.#channel = mesh.drawing.uvNames.length;
    this.#materials = colorableMaterials(mesh, selection);
    this.#texture = createColorTexture(colors);
    this.#texture.channel = this.#channel;
    const [low, high] = range;
    const { name, kind } = track.info;
    const { as, columns } = selection;
    this.legend = {
      name,
      unit: KIND_ROWS[kind] ? "" : track.info.unit, // components of unit vectors and colors have no unit
      range: as === "color" ? null : range,
      component: as === "number" ? columns[0] : as,
      colorOf: (value) => colorAt(colors, (value - low) / (high - low)),
    };
  }

  /**
   * Decode a frame to validate the track, and create its colors.
   *
   * @throws InvalidInputError if there is no such track, or options or materials do not allow it.
   * @throws like `OpenTrack.frame`
   */
  static async create(
    name: string,
    options: ColorOptions,
    mesh: ColoredMesh,
    signal: AbortSignal,
  ): Promise<TrackColors> {
    const { segments, first } = mesh.file;
    if (segments.length > 1) {
      throw new InvalidInputError("a track cannot color a file with several segments");
    }
    const track = first.track(name);
    const { map, wholeFile = false } = options;
    const ends = parseRange(options.range ?? KIND_ROWS[track.info.kind]?.range ?? DEFAULT_RANGE);
    if (map !== undefined) resolveColorMap(map);
    await track.frame(0, null, { signal }); // throws if the track cannot be decoded
    const selection = selectColumns(track.info, options.component);
    colorableMaterials(mesh, selection);
    if (selection.as === "color") {
      const unused = NUMBER_OPTIONS.find((key) => options[key] !== undefined);
      if (unused) {
        throw new InvalidInputError(
          `track ${JSON.stringify(track.info.name)} consists of colors, to which ${unused} does not` +
            " apply; omit it, or select one number by component",
        );
      }
      return new TrackColors(track, selection, [0, fullIntensity(track)], resolveColorMap("sequential"), mesh);
    }
    const range = await resolveRange(track, first.info, selection, ends, wholeFile, signal);
    const spansZero = range[0] < 0 && range[1] > 0;
    const usedMap = map ?? (spansZero ? "diverging" : "sequential");
    const colors = resolveColorMap(usedMap);
    const isCentered = usedMap === "diverging" && spansZero;
    const shownColors = isCentered ? centerAtZero(colors, ...range) : colors;
    return new TrackColors(track, selection, range, shownColors, mesh);
  }

  /** Domain by which vertices of the drawing must be split; null if no split is needed. */
  get split(): Split | null {
    const { domain } = this.#track.info;
    return domain === "vertex" ? null : domain;
  }

  /**
   * Attach to the backend of a geometry; all blocks must be added again.
   *
   * @param items - item of the track of each vertex of the geometry
   */
  attach(backend: Backend, geometry: THREE.BufferGeometry, items: Uint32Array): void {
    this.#detach();
    this.#colorBlocks.clear();
    const { name, width, glsl, evaluate } = this.#attribute();
    const previous = geometry.getAttribute(name) as THREE.BufferAttribute | undefined;
    const attribute = backend.createAttribute({
      nItems: this.#track.info.nItems,
      nVerts: items.length,
      shift: [0, 0, 0],
      attributes: [[name, width]],
      table: Uint32Array.from({ length: 2 * items.length }, (_, i) => (i % 2 ? 0 : items[i >> 1])),
      glsl: `
out vec${width} ${name};
void main() {
  vec3 value = sumOf(pairAt(gl_VertexID).x);
  ${glsl}
}`,
      items,
      evaluate,
    });
    this.#backend = attribute;
    this.#detach = () => {
      attribute.dispose();
      geometry.deleteAttribute(name);
      if (previous) geometry.setAttribute(name, previous);
    };
  }

  /** Compute the attribute of the vertices of a drawing from values of the track. */
  colorAttribute(values: TrackValues, items: Uint32Array): ColorAttribute {
    const { nItems, nColumns } = this.#track.info;
    if (values.length !== nItems * nColumns) {
      throw new InvalidInputError(
        `values must have ${nItems} x ${nColumns} numbers; got ${values.length}`,
      );
    }
    const { name, width, evaluate } = this.#attribute();
    const { columns } = this.#selection;
    const parts = new Float32Array(3 * nItems);
    for (let item = 0; item < nItems; item++) {
      columns.forEach((column, axis) => {
        parts[3 * item + axis] = this.#normalize(Number(values[item * nColumns + column]));
      });
    }
    const encoded = new Float32Array(width * items.length);
    items.forEach((item, i) => encoded.set(evaluate(parts, 3 * item), width * i));
    return { name, width, values: encoded };
  }

  /** The attribute that shaders compute from normalized values; see `#normalize`. */
  #attribute(): EncodedColor {
    if (this.#selection.as === "color") return COLOR_ATTRIBUTE;
    const isMagnitude = this.#selection.as === "magnitude";
    const [low, high] = this.#range;
    // Values are normalized by the range, so that units cannot overflow in shaders.
    const lowest = low / (high - low);
    const name = `uv${this.#channel || ""}`;
    const place = isMagnitude ? `length(value) - ${glslFloat(lowest)}` : "value.x";
    return {
      name,
      width: 2,
      glsl: `${name} = all(lessThan(abs(value), vec3(${glslFloat(MISSING_THRESHOLD)})))
        ? vec2(clamp(${place}, 0.0, 1.0) * ${glslFloat(U_SCALE)} + ${glslFloat(U_OFFSET)}, ${glslFloat(V_ROW)})
        : vec2(${MISSING_UV.map(glslFloat)});`,
      evaluate: (values, from) => {
        const [x, y, z] = [values[from], values[from + 1], values[from + 2]];
        const isThere = Math.max(Math.abs(x), Math.abs(y), Math.abs(z)) < MISSING_THRESHOLD;
        const at = isMagnitude ? Math.hypot(x, y, z) - lowest : x;
        return colorUv(isThere ? at : NaN);
      },
    };
  }

  /** Divide a number by the length of the range, after subtracting its low end (not for magnitudes). */
  #normalize(value: number): number {
    const [low, high] = this.#range;
    const part = (value - (this.#selection.as === "magnitude" ? 0 : low)) / (high - low);
    return Number.isFinite(part) ? part : MISSING_VALUE;
  }

  /** Load a block of the track; if it fails, report the error and return missing values. */
  async fields(block: number, signal: AbortSignal): Promise<BlockFields> {
    try {
      const { columns } = this.#selection;
      return this.#toPositionFields(await this.#track.fields(block, { signal, columns }));
    } catch (error) {
      signal.throwIfAborted();
      const { file, send } = this.#mesh;
      const { name, nItems } = this.#track.info;
      send({ type: "error", error: error as Error, block, track: name });
      return missingFields(file.first.info.blocks[block], block, nItems);
    }
  }

  /** Add a loaded block of the track that belongs to a block of the mesh. */
  addBlock(fields: BlockFields, meshBlock: LoadedBlock): void {
    const colorBlock = withoutFields(fields);
    this.#backend?.upload(fields, colorBlock);
    this.#colorBlocks.set(meshBlock, colorBlock);
  }

  removeBlock(meshBlock: LoadedBlock): void {
    const colorBlock = this.#colorBlocks.get(meshBlock);
    if (colorBlock) this.#backend?.release(colorBlock);
    this.#colorBlocks.delete(meshBlock);
  }

  /** Show the picture at a moment of the mesh, if the blocks of the track are loaded. */
  show(moment: Moment): void {
    const [block, next] = [moment.block, moment.next].map((meshBlock) => this.#colorBlocks.get(meshBlock));
    if (!block || !next) return;
    this.#backend?.show(composePicture({ ...moment, block, next }));
    if (!this.#restore.length) this.#applyToMaterials();
  }

  /** Restore the materials of the mesh. */
  dispose(): void {
    for (const restore of this.#restore) restore();
    this.#detach();
    this.#texture.dispose();
  }

  #applyToMaterials(): void {
    const isColor = this.#selection.as === "color";
    for (const material of this.#materials) {
      const map = hasMap(material) ? { map: isColor ? null : this.#texture } : {};
      this.#restore.push(overrideMaterial(material, { ...map, vertexColors: isColor, showsValues: true }));
    }
  }

  /** Convert the selected columns, normalized, to the three axes of position fields. */
  #toPositionFields(block: TrackFields): BlockFields {
    const { nColumns, origin, nFrames, nModes, nVerts } = block;
    const [low, high] = this.#range;
    const axes = (numbers: Float32Array) => {
      const padded = new Float32Array((numbers.length / nColumns) * 3);
      for (let row = 0; 3 * row < padded.length; row++) {
        for (let axis = 0; axis < nColumns; axis++) {
          const part = numbers[row * nColumns + axis] / (high - low);
          padded[3 * row + axis] = Number.isFinite(part) ? part : MISSING_VALUE;
        }
      }
      return padded;
    };
    // An additional constant mode adds the origin of each column.
    const weights = axes(block.weights);
    const constant = [0, 0, 0];
    origin.forEach((value, axis) => (constant[axis] = this.#normalize(value)));
    const all = new Float32Array(3 * (nModes + 1) * nFrames);
    for (let t = 0; t < nFrames; t++) {
      all.set(weights.subarray(3 * nModes * t, 3 * nModes * (t + 1)), 3 * (nModes + 1) * t);
      all.set(constant, 3 * (nModes + 1) * (t + 1) - 3);
    }
    const fields = new Int16Array((nModes + 1) * nVerts).fill(1);
    fields.set(block.fields);
    return {
      ...block,
      ...{ nModes: nModes + 1, fields, weights: all },
      means: Float64Array.of(...block.means, 1),
      correctionOffsets: axes(block.correctionOffsets),
    };
  }
}

/** Fields of a block with only missing values. */
function missingFields({ start, nFrames }: BlockInfo, number: number, nItems: number): BlockFields {
  return {
    ...{ index: number, start, nFrames, nModes: 1, nVerts: nItems },
    fields: new Int16Array(nItems).fill(1),
    means: Float64Array.of(1),
    weights: new Float32Array(3 * nFrames).fill(MISSING_VALUE),
    correctionStarts: new Uint32Array(nFrames + 1),
    correctionVertices: new Uint32Array(0),
    correctionOffsets: new Float32Array(0),
  };
}

/** The number that means full intensity of a color. */
function fullIntensity({ info }: OpenTrack): number {
  return { uint8: 255, uint16: 65535 }[info.numberType as string] ?? 1;
}

/** Colors of the file are sRGB; vertex colors of three.js are linear. */
const COLOR_ATTRIBUTE = {
  name: "color",
  width: 3,
  glsl: `bool isThere = all(lessThan(abs(value), vec3(${glslFloat(MISSING_THRESHOLD)})));
    vec3 screen = clamp(value, 0.0, 1.0);
    vec3 light = mix(pow((screen + 0.055) / 1.055, vec3(2.4)), screen / 12.92,
      vec3(lessThanEqual(screen, vec3(0.04045))));
    color = isThere ? light : vec3(${glslFloat(MISSING_INTENSITY)});`,
  evaluate(values: Float32Array, from: number) {
    const [...color] = values.subarray(from, from + 3);
    const isThere = color.every((value) => Math.abs(value) < MISSING_THRESHOLD);
    return color.map((value) => (isThere ? srgbToLinear(Math.min(Math.max(value, 0), 1)) : MISSING_INTENSITY));
  },
} as const;

/** Return the materials that can show colors. @throws InvalidInputError if there are none. */
function colorableMaterials({ material, drawing }: ColoredMesh, { as }: Selection): readonly THREE.Material[] {
  const materials = [material].flat();
  if (as === "color") return materials;
  if (drawing.uvNames.length >= MAX_UV_SETS) {
    throw new InvalidInputError(
      `the file has ${MAX_UV_SETS} or more UV sets, which are all that three.js supports; coloring by` +
        " a track needs one",
    );
  }
  const mapped = materials.filter(hasMap);
  if (mapped.length) return mapped;
  throw new InvalidInputError(
    "no material of the mesh can be colored by a track: none has a map; use one such as" +
      " MeshStandardMaterial",
  );
}

/** Format a number in GLSL. */
function glslFloat(value: number): string {
  return `(${value.toExponential()})`;
}
