// A track as the colours of a mesh: a script of its own, which comes with the first `colorBy`.

import * as THREE from "three";

import { InvalidInputError } from "../../errors.js";
import type { BlockFields, BlockInfo, OpenTrack, ReelInfo, TrackFields } from "../../types.js";
import type { HeldBlock, Moment } from "../held_block.js";
import type { Stage, ValueStage } from "../stage.js";
import {
  colorAt,
  type ColorMap,
  type Colors,
  colorsOf,
  NOWHERE,
  OFFSET,
  ROW,
  SCALE,
  textureOf,
} from "./color_map.js";
import { checkedRange, sampledRange, type Shown, shownOf } from "./color_range.js";

/** Sets of texture coordinates that three.js has. */
const MOST_UVS = 4;

/** Numbers of this size and beyond are none; places in a range are of the size of 1. */
const MISSING = 1e35;

/** So large that a part of it, on the way to another frame, is still missing. */
const BEYOND = 3e38;

/** How a track is shown. */
export interface ColorOptions {
  /**
   * Default: "diverging" if the range has 0 inside, else "sequential".
   */
  map?: ColorMap;
  /**
   * The numbers at the ends of the map; what is beyond has the colours of the ends. Default: the
   * least and the largest number in eight frames of the first block, and, if they lie on both sides
   * of 0, as far on both.
   */
  range?: readonly [number, number];
  /** A column, from 0 on, or the length of up to three. Default: the column, or the length. */
  component?: number | "magnitude";
}

/** What colours mean: for a legend. */
export interface ColorLegend {
  readonly name: string;
  /** Such as "Pa"; empty where the file does not say. */
  readonly unit: string;
  readonly range: readonly [number, number];
  readonly component: number | "magnitude";
  /** Red, green and blue of a number, 0..255; grey of NaN. */
  colorOf(value: number): [number, number, number];
}

/** What is coloured. */
export interface ColoredMesh {
  readonly info: ReelInfo;
  readonly materials: readonly THREE.Material[];
  /** Names of texture coordinates, by channel. */
  readonly uvNames: readonly string[];
  /** Is told of a block of the track that cannot be had. */
  readonly onError: (error: Error, block: number) => void;
}

/** A material with a map. */
type Dressed = THREE.Material & { map: THREE.Texture | null; color?: THREE.Color };

/** Colours of a mesh by a track, from `begin` until `dispose`. */
export class TrackColors {
  readonly legend: ColorLegend;
  readonly #track: OpenTrack;
  readonly #shown: Shown;
  readonly #mesh: ColoredMesh;
  readonly #channel: number;
  readonly #materials: readonly Dressed[];
  readonly #texture: THREE.DataTexture;
  /** Gives the materials back what they had. */
  readonly #undress: (() => void)[] = [];
  /** The sums of fields of the track, of each block that is there. */
  readonly #held = new Map<HeldBlock, HeldBlock>();
  #values: ValueStage | null = null;

  private constructor(
    track: OpenTrack,
    shown: Shown,
    range: [number, number],
    colors: Colors,
    mesh: ColoredMesh,
  ) {
    this.#track = track;
    this.#shown = shown;
    this.#mesh = mesh;
    this.#channel = mesh.uvNames.length;
    this.#materials = dressedOf(mesh);
    this.#texture = textureOf(colors);
    this.#texture.channel = this.#channel;
    const [low, high] = range;
    this.legend = {
      name: track.info.name,
      unit: track.info.unit,
      range,
      component: shown.isMagnitude ? "magnitude" : shown.columns[0],
      colorOf: (value) => colorAt(colors, (value - low) / (high - low)),
    };
  }

  /**
   * The colours of a mesh by a track, once it is known that the track can be decoded.
   *
   * @throws InvalidInputError where options or materials do not allow it.
   * @throws what `OpenTrack.frame` throws
   */
  static async of(
    track: OpenTrack,
    options: ColorOptions,
    mesh: ColoredMesh,
    signal: AbortSignal,
  ): Promise<TrackColors> {
    const given = options.range && checkedRange(options.range);
    if (options.map !== undefined) colorsOf(options.map);
    await track.frame(0, undefined, { signal }); // says what is wrong with the track
    const shown = shownOf(track.info, options.component);
    dressedOf(mesh);
    const range = given ?? (await sampledRange(track, mesh.info.blocks[0], shown, signal));
    const usual = range[0] < 0 && range[1] > 0 ? "diverging" : "sequential";
    return new TrackColors(track, shown, range, colorsOf(options.map ?? usual), mesh);
  }

  /** What the vertices of the drawing have to be split for; null for nothing. */
  get split(): "face" | "corner" | null {
    const { domain } = this.#track.info;
    return domain === "face" || domain === "corner" ? domain : null;
  }

  /**
   * Goes on a stage, or on another; blocks have to be held anew.
   *
   * @param items - vertex, face or corner of each vertex of the drawing
   */
  begin(stage: Stage, items: Uint32Array): void {
    this.#values?.dispose();
    this.#held.clear();
    const { isMagnitude } = this.#shown;
    const [low, high] = this.legend.range;
    // All is in parts of the range, so that no unit is too large or too small for shaders.
    const lowest = low / (high - low);
    const name = `uv${this.#channel || ""}`;
    const place = isMagnitude ? `length(value) - ${float(lowest)}` : "value.x";
    this.#values = stage.values({
      nItems: this.#track.info.nItems,
      items,
      name,
      glsl: `${name} = all(lessThan(abs(value), vec3(${float(MISSING)})))
        ? vec2(clamp(${place}, 0.0, 1.0) * ${float(SCALE)} + ${float(OFFSET)}, ${float(ROW)})
        : vec2(${NOWHERE.map(float)});`,
      coordinates: (values, from) => {
        const [x, y, z] = [values[from], values[from + 1], values[from + 2]];
        const isThere = Math.max(Math.abs(x), Math.abs(y), Math.abs(z)) < MISSING;
        const at = isMagnitude ? Math.hypot(x, y, z) - lowest : x;
        return isThere ? [Math.min(Math.max(at, 0), 1) * SCALE + OFFSET, ROW] : NOWHERE;
      },
    });
  }

  /** The track in a block, or that it is missing there, which is told. */
  async fields(block: number, signal: AbortSignal): Promise<BlockFields> {
    try {
      return this.#places(await this.#track.fields(block, { signal }));
    } catch (error) {
      signal.throwIfAborted();
      this.#mesh.onError(error as Error, block);
      return missingFields(this.#mesh.info.blocks[block], block, this.#track.info.nItems);
    }
  }

  /** Takes the track in a block of the mesh. */
  hold(fields: BlockFields, held: HeldBlock, ofMesh: HeldBlock): void {
    this.#values?.hold(fields, held);
    this.#held.set(ofMesh, held);
  }

  release(ofMesh: HeldBlock): void {
    const held = this.#held.get(ofMesh);
    if (held) this.#values?.release(held);
    this.#held.delete(ofMesh);
  }

  /** The same moment of the track; null where it is not there. */
  momentOf(moment: Moment): Moment | null {
    const [block, next] = [moment.block, moment.next].map((one) => this.#held.get(one));
    return block && next ? { ...moment, block, next, nMoving: Infinity } : null;
  }

  /** Shows a picture of the track. */
  show(picture: Parameters<ValueStage["show"]>[0]): void {
    this.#values?.show(picture);
    if (!this.#undress.length) this.#dress();
  }

  /** Gives the mesh its own look back. */
  dispose(): void {
    for (const undress of this.#undress) undress();
    this.#values?.dispose();
    this.#texture.dispose();
  }

  #dress(): void {
    for (const material of this.#materials) {
      const { map, vertexColors } = material;
      const color = material.color?.clone();
      this.#undress.push(() => {
        Object.assign(material, { map, vertexColors, needsUpdate: true });
        if (color) material.color?.copy(color);
      });
      Object.assign(material, { map: this.#texture, vertexColors: false, needsUpdate: true });
      material.color?.set(0xffffff);
    }
  }

  /** Columns that are shown as the three axes of positions, in parts of the range. */
  #places(block: TrackFields): BlockFields {
    const { columns, isMagnitude } = this.#shown;
    const { nColumns, origin, nFrames, nModes, nBlockModes, nVerts } = block;
    const [low, high] = this.legend.range;
    const axes = (numbers: Float32Array) => {
      const found = new Float32Array((numbers.length / nColumns) * 3);
      for (let row = 0; 3 * row < found.length; row++) {
        columns.forEach((column, axis) => {
          found[3 * row + axis] = numbers[row * nColumns + column] / (high - low);
        });
      }
      return found;
    };
    // One more mode, which rests: the origin of each column, from the low end of the range on.
    const weights = axes(block.weights);
    const resting = [0, 0, 0];
    columns.forEach((column, axis) => {
      resting[axis] = (origin[column] - (isMagnitude ? 0 : low)) / (high - low);
    });
    const all = new Float32Array(3 * (nModes + 1) * nFrames);
    for (let t = 0; t < nFrames; t++) {
      all.set(weights.subarray(3 * nModes * t, 3 * nModes * (t + 1)), 3 * (nModes + 1) * t);
      all.set(resting, 3 * (nModes + 1) * (t + 1) - 3);
    }
    const fields = new Int16Array((nModes + 1) * nVerts).fill(1);
    fields.set(block.fields);
    return {
      ...block,
      ...{ nModes: nModes + 1, nBlockModes: nBlockModes + 1, fields, weights: all },
      means: Float64Array.of(...block.means, 1),
      correctionOffsets: axes(block.correctionOffsets),
    };
  }
}

/** A block without numbers. */
function missingFields({ start, nFrames }: BlockInfo, number: number, nItems: number): BlockFields {
  return {
    ...{ number, start, nFrames, nModes: 1, nBlockModes: 1, nVerts: nItems },
    fields: new Int16Array(nItems).fill(1),
    means: Float64Array.of(1),
    weights: new Float32Array(3 * nFrames).fill(BEYOND),
    correctionStarts: new Uint32Array(nFrames + 1),
    correctionVertices: new Uint32Array(0),
    correctionOffsets: new Float32Array(0),
  };
}

/** The materials that can show colours. @throws InvalidInputError where none can. */
function dressedOf({ materials, uvNames }: ColoredMesh): Dressed[] {
  if (uvNames.length >= MOST_UVS) {
    throw new InvalidInputError(
      `the file has ${MOST_UVS} or more sets of texture coordinates, which are all that three.js` +
        " has; colours of a track need one",
    );
  }
  const found = materials.filter((material): material is Dressed => "map" in material);
  if (found.length) return found;
  throw new InvalidInputError(
    "no material of the mesh can show colours of a track: none has a map; use one such as" +
      " MeshStandardMaterial",
  );
}

/** A number in GLSL. */
function float(value: number): string {
  return `(${value.toExponential()})`;
}
