// A track as the colours of a mesh: a script of its own, which comes with the first `colorBy`.

import * as THREE from "three";

import { InvalidInputError } from "../../errors.js";
import type {
  BlockFields,
  BlockInfo,
  OpenTrack,
  ReelInfo,
  TrackFields,
  TrackValues,
} from "../../types.js";
import type { HeldBlock, Moment } from "../held_block.js";
import type { Stage, ValueSetup, ValueStage } from "../stage.js";
import {
  about0,
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
import {
  type Component,
  DEFAULT_RANGE,
  rangeEnds,
  type Shown,
  shownOf,
  shownRange,
} from "./color_range.js";

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
   * The numbers at the ends of the map; what is beyond has the colours of the ends. Two numbers, or a
   * text such as "0:500" or "2%:98%", whose percentiles are of eight frames of the first block and,
   * if they lie on both sides of 0, as far on both; one that is beyond 0 by no more than the error
   * bound of the track is 0. Default: "2%:98%"; of normals -1 to 1.
   */
  range?: readonly [number, number] | string;
  /**
   * Whether percentiles are of eight frames of the whole file (of all its frames, if one is 0 or
   * 100), the blocks of which are read for them. Default: false.
   */
  isOfFile?: boolean;
  /**
   * A column, from 0 on, the same as "x", "y" or "z" of up to three, or their length, "magnitude".
   * Default: the column; of colours these; of normals "x"; else the length.
   */
  component?: Component;
}

/** What colours mean: for a legend. */
export interface ColorLegend {
  readonly name: string;
  /** Such as "Pa"; empty where the file does not say. */
  readonly unit: string;
  /** Null where the track has colours, which are shown as they are. */
  readonly range: readonly [number, number] | null;
  readonly component: number | "magnitude" | "color";
  /** Red, green and blue of a number, 0..255; grey of NaN. */
  colorOf(value: number): [number, number, number];
}

/** An attribute of a geometry that has the colours of values, by the map of the material. */
export interface ColorAttribute {
  /** "color", or texture coordinates such as "uv1". */
  readonly name: string;
  /** Numbers of each vertex. */
  readonly width: 2 | 3;
  readonly values: Float32Array;
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

/** Options that say how numbers are shown. */
const OF_NUMBERS = ["range", "map", "isOfFile"] as const;

/** A material, perhaps with a map. */
type Dressed = THREE.Material & { map?: THREE.Texture | null; color?: THREE.Color };

/** Grey of what has no colour, as light. */
const NO_COLOR = 0.2158;

/** Colours of a mesh by a track, from `begin` until `dispose`. */
export class TrackColors {
  readonly legend: ColorLegend;
  readonly #track: OpenTrack;
  readonly #shown: Shown;
  readonly #range: readonly [number, number];
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
    this.#range = range;
    this.#mesh = mesh;
    this.#channel = mesh.uvNames.length;
    this.#materials = dressedOf(mesh, shown);
    this.#texture = textureOf(colors);
    this.#texture.channel = this.#channel;
    const [low, high] = range;
    const { name, unit, kind } = track.info;
    const { as, columns } = shown;
    this.legend = {
      name,
      unit: kind === "normal" || as === "color" ? "" : unit, // parts of a length of 1; colours
      range: as === "color" ? null : range,
      component: as === "number" ? columns[0] : as,
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
    const { map, isOfFile = false } = options;
    const isNormal = track.info.kind === "normal" && options.component !== "magnitude";
    const ends = rangeEnds(options.range ?? (isNormal ? [-1, 1] : DEFAULT_RANGE));
    if (map !== undefined) colorsOf(map);
    await track.frame(0, undefined, { signal }); // says what is wrong with the track
    const shown = shownOf(track.info, options.component);
    dressedOf(mesh, shown);
    if (shown.as === "color") {
      const useless = OF_NUMBERS.find((key) => options[key] !== undefined);
      if (useless) {
        throw new InvalidInputError(
          `track ${JSON.stringify(track.info.name)} has colours, which are shown as they are; leave` +
            ` ${useless} out, or show one of their numbers by component`,
        );
      }
      return new TrackColors(track, shown, [0, whiteOf(track)], colorsOf("sequential"), mesh);
    }
    const range = await shownRange(track, mesh.info, shown, ends, isOfFile, signal);
    const is0Inside = range[0] < 0 && range[1] > 0;
    const name = map ?? (is0Inside ? "diverging" : "sequential");
    const colors = colorsOf(name);
    const isAbout0 = name === "diverging" && is0Inside;
    const shownColors = isAbout0 ? about0(colors, ...range) : colors;
    return new TrackColors(track, shown, range, shownColors, mesh);
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
    const { nItems } = this.#track.info;
    this.#values = stage.values({ nItems, items, ...this.#attribute() });
  }

  /** The attribute of vertices of a drawing, from values of the track at a frame. */
  attributeOf(values: TrackValues, items: Uint32Array): ColorAttribute {
    const { nItems, nColumns } = this.#track.info;
    if (values.length !== nItems * nColumns) {
      throw new InvalidInputError(
        `values must be the ${nItems} x ${nColumns} numbers of a frame; got ${values.length}`,
      );
    }
    const { name, width, coordinates } = this.#attribute();
    const { columns } = this.#shown;
    const parts = new Float32Array(3 * nItems);
    for (let item = 0; item < nItems; item++) {
      columns.forEach((column, axis) => {
        parts[3 * item + axis] = this.#partOf(Number(values[item * nColumns + column]));
      });
    }
    const found = new Float32Array(width * items.length);
    items.forEach((item, i) => found.set(coordinates(parts, 3 * item), width * i));
    return { name, width, values: found };
  }

  /** What shaders make of parts of the range, as `#places` has them. */
  #attribute(): Omit<ValueSetup, "nItems" | "items"> {
    if (this.#shown.as === "color") return COLOR_ATTRIBUTE;
    const isMagnitude = this.#shown.as === "magnitude";
    const [low, high] = this.#range;
    // All is in parts of the range, so that no unit is too large or too small for shaders.
    const lowest = low / (high - low);
    const name = `uv${this.#channel || ""}`;
    const place = isMagnitude ? `length(value) - ${float(lowest)}` : "value.x";
    return {
      name,
      width: 2,
      glsl: `${name} = all(lessThan(abs(value), vec3(${float(MISSING)})))
        ? vec2(clamp(${place}, 0.0, 1.0) * ${float(SCALE)} + ${float(OFFSET)}, ${float(ROW)})
        : vec2(${NOWHERE.map(float)});`,
      coordinates: (values, from) => {
        const [x, y, z] = [values[from], values[from + 1], values[from + 2]];
        const isThere = Math.max(Math.abs(x), Math.abs(y), Math.abs(z)) < MISSING;
        const at = isMagnitude ? Math.hypot(x, y, z) - lowest : x;
        return isThere ? [Math.min(Math.max(at, 0), 1) * SCALE + OFFSET, ROW] : NOWHERE;
      },
    };
  }

  /** A number in parts of the range: of magnitudes from 0 on, else from its low end. */
  #partOf(value: number): number {
    const [low, high] = this.#range;
    const part = (value - (this.#shown.as === "magnitude" ? 0 : low)) / (high - low);
    return Number.isFinite(part) ? part : BEYOND;
  }

  /** The track in a block, or that it is missing there, which is told. */
  async fields(block: number, signal: AbortSignal): Promise<BlockFields> {
    try {
      const { columns } = this.#shown;
      return this.#places(await this.#track.fields(block, { signal, columns }));
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
      const maps = (one: typeof map) => ("map" in material ? { map: one } : {});
      const color = material.color?.clone();
      this.#undress.push(() => {
        Object.assign(material, maps(map), { vertexColors, needsUpdate: true });
        if (color) material.color?.copy(color);
      });
      const isColor = this.#shown.as === "color";
      const worn = maps(isColor ? null : this.#texture);
      Object.assign(material, worn, { vertexColors: isColor, needsUpdate: true });
      material.color?.set(0xffffff);
    }
  }

  /** Columns that are shown as the three axes of positions, in parts of the range. */
  #places(block: TrackFields): BlockFields {
    const { nColumns, origin, nFrames, nModes, nBlockModes, nVerts } = block;
    const [low, high] = this.#range;
    const axes = (numbers: Float32Array) => {
      const found = new Float32Array((numbers.length / nColumns) * 3);
      for (let row = 0; 3 * row < found.length; row++) {
        for (let axis = 0; axis < nColumns; axis++) {
          const part = numbers[row * nColumns + axis] / (high - low);
          found[3 * row + axis] = Number.isFinite(part) ? part : BEYOND;
        }
      }
      return found;
    };
    // One more mode, which rests: the origin of each column, from the low end of the range on.
    const weights = axes(block.weights);
    const resting = [0, 0, 0];
    origin.forEach((one, axis) => (resting[axis] = this.#partOf(one)));
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

/** The number of a colour that is all there. */
function whiteOf({ info }: OpenTrack): number {
  return { uint8: 255, uint16: 65535 }[info.numberType as string] ?? 1;
}

/** Colours as they are; three.js counts in light, and files as screens show them. */
const COLOR_ATTRIBUTE = {
  name: "color",
  width: 3,
  glsl: `bool isThere = all(lessThan(abs(value), vec3(${float(MISSING)})));
    vec3 screen = clamp(value, 0.0, 1.0);
    vec3 light = mix(pow((screen + 0.055) / 1.055, vec3(2.4)), screen / 12.92,
      vec3(lessThanEqual(screen, vec3(0.04045))));
    color = isThere ? light : vec3(${float(NO_COLOR)});`,
  coordinates(values: Float32Array, from: number) {
    const [...color] = values.subarray(from, from + 3);
    const isThere = color.every((one) => Math.abs(one) < MISSING);
    return color.map((one) => (isThere ? lightOf(one) : NO_COLOR));
  },
} as const;

/** The materials that can show colours. @throws InvalidInputError where none can. */
function dressedOf({ materials, uvNames }: ColoredMesh, { as }: Shown): readonly Dressed[] {
  if (as === "color") return materials;
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

/** Light of a colour as screens show it, 0..1. */
function lightOf(value: number): number {
  const shown = Math.min(Math.max(value, 0), 1);
  return shown <= 0.04045 ? shown / 12.92 : ((shown + 0.055) / 1.055) ** 2.4;
}

/** A number in GLSL. */
function float(value: number): string {
  return `(${value.toExponential()})`;
}
