// Decodes further tracks of a stream, whose bytes come when they are asked for: beside the engine of
// the positions, which never waits for them.

import { Core } from "../core/core.js";
import { BlockDecoder, POSITION_COLUMNS } from "../decode/block_decoder.js";
import { type Connectivity, decodeConnectivity, inverse } from "../decode/connectivity.js";
import type { DecodedBlock } from "../decode/decoded_block.js";
import { exactPositions, typeOfPositions } from "../decode/exact_positions.js";
import { type ExactCore, ExactDecoder } from "../decode/exact_values.js";
import { frameOf, type Positions, valuesOf } from "../decode/frames.js";
import { Items } from "../decode/items.js";
import { requireBlock } from "../decode/memory.js";
import { REEL } from "../decode/methods.js";
import { BYTES, integersOf } from "../decode/number_types.js";
import { type Piece, piecesOf } from "../decode/pieces.js";
import { type MovingSurface, exactlyPredicted, predictedValues } from "../decode/predicted.js";
import { SpreadBlock } from "../decode/spread_block.js";
import {
  type StoredTrackBlock,
  type Track,
  readTrack,
  readTrackBlock,
  withLayout,
} from "../decode/track.js";
import { ModesBlock, type Placed, type TrackBlock } from "../decode/track_block.js";
import { ValuesBlock } from "../decode/values_block.js";
import { CorruptStreamError } from "../errors.js";
import {
  type StoredBlock,
  blockPayload,
  readBlock,
  readPositions,
} from "../stream/block_sections.js";
import type { BlockPlace } from "../stream/index_section.js";
import { Section } from "../stream/layout.js";
import type { Stream } from "../stream/stream.js";
import { Polygons, readSizes } from "../surface/polygons.js";
import type { TrackFields, TrackValues } from "../types.js";
import { KeptBlocks, type Prepare } from "./kept_blocks.js";
import type { Read } from "./opening.js";
import { type StoredItems, TrackItems } from "./track_items.js";

/** The number of positions without modes among tracks. */
export const POSITIONS = -1;

/** Blocks of a track that was asked for. */
type TrackBlocks = KeptBlocks<TrackBlock>;

export class TrackEngine {
  private readonly mesh: Items<Connectivity>;
  private readonly items: TrackItems;
  private readonly tracks = new Map<number, TrackBlocks>();
  private last: TrackBlocks | null = null;
  /** What decodes exact values; it comes where there are some. */
  private exactCore: Promise<ExactCore> | null = null;
  private readonly positions: BlockDecoder;
  private moving: MovingSurface | null = null;
  private readonly exactDecoders = new Map<Items, ExactDecoder>();
  private readonly pieces: readonly Piece[];

  /**
   * @param stream - As the engine of the positions gives it.
   * @param readExact - Gives the bytes of the module that decodes exact values.
   * @throws CorruptStreamError where connectivity or order are damaged.
   */
  constructor(
    private readonly core: Core,
    private readonly read: Read,
    private readonly stream: Stream,
    private readonly readExact: () => Promise<Uint8Array>,
  ) {
    this.mesh = new Items(core, decodeConnectivity(core, stream.header, stream.leading));
    this.items = new TrackItems(this.mesh, () => this.polygons());
    this.positions = new BlockDecoder(this.mesh, POSITION_COLUMNS, stream.memory);
    this.pieces = piecesOf(stream);
  }

  /**
   * Values of a frame of a track; frame and track have to be there.
   *
   * @param track - From 0 on, or `POSITIONS`.
   * @throws MeshReelError as `readTrack`, `TrackItems.of` and `readTrackBlock`.
   */
  async values(track: number, number: number, signal: AbortSignal): Promise<TrackValues> {
    this.last = this.open(track);
    const [block, time] = await this.last.ofFrame(number, signal);
    return block.frame(time);
  }

  /** Columns of a track in a piece, of `piecesOf`, for shaders; as `values`. */
  async fields(
    track: number,
    piece: number,
    columns: readonly number[],
    signal: AbortSignal,
  ): Promise<TrackFields> {
    const { start, nFrames, block } = this.pieces[piece];
    const blocks = this.open(track);
    const isPart = nFrames < this.stream.places[block].nFrames;
    if (isPart) this.last = blocks; // pages ask for the next block late, for the next piece early
    const [found, first] = isPart
      ? await blocks.ofFrame(start, signal, nFrames)
      : [await blocks.block(block, signal), 0];
    return { ...found.fields(columns, first, nFrames), number: piece, start };
  }

  /** Decodes what is likely to be asked for next. */
  async goAhead(): Promise<void> {
    await this.last?.goAhead();
  }

  private open(number: number): TrackBlocks {
    const before = this.tracks.get(number);
    if (before) return before;
    const { leading, starts } = this.stream;
    if (number === POSITIONS) {
      const found = new KeptBlocks(starts, this.preparedPositions());
      this.tracks.set(number, found);
      return found;
    }
    const track = readTrack(leading.filter(({ id }) => id === Section.TRACK)[number].payload);
    const found = new KeptBlocks(starts, this.spread(number, track, this.items.of(track)));
    this.tracks.set(number, found);
    return found;
  }

  /** How the blocks of positions without modes are decoded. */
  private preparedPositions(): Prepare<TrackBlock> {
    const { header, starts } = this.stream;
    const numbers = typeOfPositions(header);
    return async (block, signal) => {
      const stored = readPositions(...(await this.group(block, signal)), block, starts[block]);
      this.requirePositions(stored);
      const exact = await this.exactOf(this.mesh);
      return () => {
        const found = exactPositions(header, stored, exact);
        const shape = [stored.nFrames, POSITION_COLUMNS] as const;
        return new ValuesBlock(block, ...shape, numbers, found, header.origin);
      };
    };
  }

  /** How the blocks of a track are decoded, so that each corner has its value. */
  private spread(number: number, track: Track, of: StoredItems): Prepare<TrackBlock> {
    const { spread } = of;
    if (!spread) return this.prepared(number, track, of);
    const prepare = this.prepared(number, track.shared === "rows" ? track : ofVertices(track), of);
    return async (block, signal) => {
      const decode = await prepare(block, signal);
      return () => new SpreadBlock(decode(), spread, track.nColumns, track.numbers);
    };
  }

  /** How the stored values of a track are decoded. */
  private prepared(number: number, track: Track, of: StoredItems): Prepare<TrackBlock> {
    const { core } = this;
    const { items, mostItems, vertexOfRow } = of;
    const { nColumns, numbers, placement } = track;
    const stored = (block: number, signal: AbortSignal): Promise<StoredTrackBlock> =>
      this.stored(number, block, [mostItems, track.nCoded], !placement, numbers.sizeBytes, signal);
    if (!placement) {
      return async (block, signal) => {
        const found = await stored(block, signal);
        const { nFrames } = found;
        const positions = track.isPredicted ? await this.positionsOf(block, signal) : null;
        const exact = await this.exactOf(items);
        const data = blockPayload(found, Section.VALUES);
        return () => {
          const coded = positions ? integersOf(numbers) : numbers;
          const decoded = exact.decode(data, nFrames, nColumns, coded);
          const values = positions ? exactlyPredicted(track, decoded, positions()) : decoded;
          return new ValuesBlock(block, nFrames, nColumns, numbers, values);
        };
      };
    }
    const decoder = new BlockDecoder(items, track.nCoded, this.stream.memory);
    return async (block, signal) => {
      const found = await stored(block, signal);
      const decode = await decoder.prepare(withLayout(found), async (key) =>
        withLayout(await stored(key, signal)),
      );
      const positions = track.isPredicted ? await this.positionsOf(block, signal) : null;
      const missing = found.sections.get(Section.MISSING);
      const exact = missing && (await this.exactOf(items));
      return () => {
        const flags = missing && exact?.decode(missing, found.nFrames, nColumns, BYTES);
        if (flags) requireFlags(flags as Uint8Array, block);
        const missingOnes = (flags as Uint8Array) ?? null;
        if (!positions) {
          return new ModesBlock(core, { ...track, placement }, decode(), missingOnes);
        }
        const surface = { ...this.surface(), vertexOfRow };
        const values = this.combined({ ...track, placement }, positions(), decode(), surface);
        missingOnes?.forEach((isMissing, i) => {
          if (isMissing) values[i] = NaN;
        });
        return new ValuesBlock(block, found.nFrames, nColumns, numbers, values);
      };
    };
  }

  /** What decodes the positions of a block, frame after frame, as they go out. */
  private async positionsOf(block: number, signal: AbortSignal): Promise<() => Positions[]> {
    const { header, places, starts } = this.stream;
    if (header.method !== REEL) {
      const exact = await this.open(POSITIONS).block(block, signal);
      return () =>
        Array.from({ length: places[block].nFrames }, (_, t) => exact.frame(t) as Positions);
    }
    const stored = async (number: number): Promise<StoredBlock> =>
      readBlock(...(await this.group(number, signal)), number, starts[number]);
    const own = await stored(block);
    this.requirePositions(own);
    const decode = await this.positions.prepare(own, stored);
    return () => {
      const decoded = decode();
      try {
        return Array.from({ length: decoded.nFrames }, (_, t) =>
          frameOf(this.core, header, decoded, t),
        );
      } finally {
        decoded.close();
      }
    };
  }

  /** @throws MemoryLimitError where the positions of a block take more than allowed. */
  private requirePositions(stored: Omit<StoredBlock, "layout">): void {
    const { header, memory } = this.stream;
    const shape = [header.nVerts, POSITION_COLUMNS] as const;
    requireBlock(memory, stored, shape, header.vertexType);
  }

  /** The bytes of the positions of a block, and its place. */
  private async group(
    block: number,
    signal: AbortSignal,
  ): Promise<[bytes: Uint8Array, place: BlockPlace]> {
    const place = this.stream.places[block];
    const bytes = await this.read(place.position, place.position + place.sizes[0], signal);
    return [bytes, place];
  }

  /** Values that positions let expect, with what is decoded. */
  private combined(
    track: Placed,
    positions: Positions[],
    decoded: DecodedBlock,
    surface: MovingSurface,
  ): Positions {
    const { core } = this;
    try {
      const coded = (t: number): Positions => valuesOf(core, track.placement, decoded, t);
      return predictedValues(track, coded, positions, surface) as Positions;
    } finally {
      decoded.close();
    }
  }

  private surface(): MovingSurface {
    if (this.moving) return this.moving;
    const { internalFaces, nFaces, sequence } = this.mesh.graph;
    const names = inverse(sequence);
    const internal = this.core.uint32s(internalFaces, 3 * nFaces);
    const connected = internal.map((one) => names[one]);
    this.moving = { connected, polygons: this.polygons(), vertexOfRow: null };
    return this.moving;
  }

  private polygons(): Polygons {
    const { core, mesh, stream } = this;
    const { triangles, nVerts } = mesh.graph;
    const stored = stream.leading.find(({ id }) => id === Section.POLYGONS);
    const sizes = stored ? readSizes(core, stored.payload, triangles.length / 3) : null;
    return new Polygons(triangles, nVerts, sizes);
  }

  private async stored(
    track: number,
    block: number,
    shape: [nItems: number, nColumns: number],
    isExact: boolean,
    numberBytes: number,
    signal: AbortSignal,
  ): Promise<StoredTrackBlock> {
    const { places, starts, memory } = this.stream;
    const place = places[block];
    const group = track + 1; // that of the positions is the first
    const sizes = place.sizes.slice(0, group);
    const position = sizes.reduce((sum, size) => sum + size, place.position);
    const bytes = await this.read(position, position + place.sizes[group], signal);
    const first = [block, starts[block]] as [number: number, start: number];
    const size = [isExact, numberBytes, memory] as const;
    return readTrackBlock(bytes, place, position, group, first, shape, ...size);
  }

  /** What decodes exact values on vertices, faces, corners or rows. */
  private async exactOf(items: Items): Promise<ExactDecoder> {
    this.exactCore ??= this.startExact().catch((error: unknown) => {
      this.exactCore = null; // it may come another time
      throw error;
    });
    const exact = await this.exactCore;
    const before = this.exactDecoders.get(items);
    const found = before ?? new ExactDecoder(exact, this.core, items.graph);
    this.exactDecoders.set(items, found);
    return found;
  }

  private async startExact(): Promise<ExactCore> {
    const bytes = (await this.readExact()) as Uint8Array<ArrayBuffer>;
    return new Core((await WebAssembly.instantiate(bytes)).instance);
  }
}

/** A track of corners as that of the vertices whose values they have. */
function ofVertices(track: Track): Track {
  return { ...track, domain: "vertex" };
}

/** @throws CorruptStreamError where a number says neither that a value is missing nor that it is there. */
function requireFlags(flags: Uint8Array, block: number): void {
  const other = flags.find((flag) => flag > 1);
  if (other === undefined) return;
  throw new CorruptStreamError(
    `block ${block} of a track says ${other} of whether a value is missing; 0 and 1 are allowed`,
  );
}
