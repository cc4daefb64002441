// Decodes a stream whose bytes come when they are asked for; keeps two blocks.

import type { Core } from "../core/core.js";
import { BlockDecoder } from "../decode/block_decoder.js";
import { fieldsOf } from "../decode/block_fields.js";
import type { DecodedBlock } from "../decode/decoded_block.js";
import { frameOf, type Positions } from "../decode/frames.js";
import { REEL, readInfo } from "../decode/info.js";
import { type StoredBlock, readBlock } from "../stream/block_sections.js";
import type { Stream } from "../stream/stream.js";
import { readSurface } from "../surface/surface.js";
import type { BlockFields, ReelInfo, Surface } from "../types.js";
import { type Beginning, type Read, openStream } from "./opening.js";

/** Decoded blocks that are kept: the one that is played, and the next. */
const MOST_BLOCKS = 2;

export class Engine {
  readonly info: ReelInfo;
  readonly surface: Surface;
  private readonly decoder: BlockDecoder;
  /** The one used last is the last. */
  private blocks: DecodedBlock[] = [];
  /** Those on their way. */
  private readonly pending = new Map<number, Promise<DecodedBlock>>();
  private lastFrame = -1;
  /** Whether the last frames were asked for in order. */
  private isPlayed = false;

  private constructor(
    private readonly core: Core,
    private readonly read: Read,
    private readonly stream: Stream,
    early: EarlyDecoder | null,
  ) {
    const { header, leading, places } = stream;
    this.info = readInfo(stream);
    const isEarly = early?.end === places[0].position;
    if (!isEarly) early?.decoder.close();
    this.decoder = isEarly ? early.decoder : new BlockDecoder(core, header, leading);
    const { triangles } = this.decoder.connectivity;
    this.surface = readSurface(core, leading, triangles, header.nVerts);
  }

  /**
   * Reads what comes before the first block, and the index.
   *
   * @throws MeshReelError as `openStream` and the decoders.
   */
  static async open(
    core: Promise<Core>,
    read: Read,
    size: number | null,
    hasRanges: boolean,
    signal: AbortSignal,
  ): Promise<Engine> {
    let early: EarlyDecoder | null = null;
    const begin = async (beginning: Beginning): Promise<void> => {
      early = earlyDecoder(await core, beginning);
    };
    const stream = await openStream(read, size, hasRanges, signal, begin);
    return new Engine(await core, read, stream, early);
  }

  /** Positions of a frame, which has to be there. */
  async frame(number: number, signal: AbortSignal): Promise<Positions> {
    const { starts, header } = this.stream;
    const block = starts.findLastIndex((start) => start <= number);
    this.isPlayed = number === this.lastFrame + 1;
    this.lastFrame = number;
    return frameOf(this.core, header, await this.block(block, signal), number - starts[block]);
  }

  /** A block, which has to be there, for shaders. */
  async fields(block: number, signal: AbortSignal): Promise<BlockFields> {
    return fieldsOf(this.core, this.stream.header, await this.block(block, signal));
  }

  /**
   * Decodes the next block, where frames are asked for in order and are in the second half of one.
   *
   * What goes wrong is told when a frame of the block is asked for.
   */
  async goAhead(): Promise<void> {
    const { places, starts } = this.stream;
    const next = starts.findLastIndex((start) => start <= this.lastFrame) + 1;
    const isNear = 2 * this.lastFrame >= starts[next - 1] + starts[next];
    const isDecoded = this.blocks.some((block) => block.number === next);
    if (!this.isPlayed || !isNear || isDecoded || this.pending.size || next >= places.length) return;
    await this.block(next, new AbortController().signal).catch(() => {});
  }

  /** A block: kept from before, on its way, or decoded now. */
  private async block(number: number, signal: AbortSignal): Promise<DecodedBlock> {
    const kept = this.blocks.find((block) => block.number === number);
    const found = kept ?? (await (this.pending.get(number) ?? this.begin(number, signal)));
    signal.throwIfAborted();
    this.blocks = [...this.blocks.filter((block) => block !== found), found];
    return found;
  }

  private begin(number: number, signal: AbortSignal): Promise<DecodedBlock> {
    const found = this.decoded(number, signal).finally(() => this.pending.delete(number));
    this.pending.set(number, found);
    return found;
  }

  private async decoded(number: number, signal: AbortSignal): Promise<DecodedBlock> {
    const stored = await this.stored(number, signal);
    const reference = number - stored.layout.reference;
    const isKeyMissing = reference >= 0 && !this.decoder.hasKeyOf(stored);
    const key = isKeyMissing ? await this.stored(reference, signal) : stored;
    signal.throwIfAborted();
    while (this.blocks.length >= MOST_BLOCKS) this.blocks.shift()!.close();
    const found = this.decoder.decode(stored, () => key);
    this.blocks.push(found);
    return found;
  }

  private async stored(number: number, signal: AbortSignal): Promise<StoredBlock> {
    const { places, starts } = this.stream;
    const place = places[number];
    const end = place.position + place.sizes[0];
    const bytes = await this.read(place.position, end, signal);
    return readBlock(bytes, place, number, starts[number]);
  }
}

/** A decoder that was made while the end of its stream was on its way. */
interface EarlyDecoder {
  readonly decoder: BlockDecoder;
  /** Byte of the stream at which the first block begins. */
  readonly end: number;
}

/** Decodes what leads to the blocks; null where that fails, which is told once all is here. */
function earlyDecoder(
  core: Core,
  { header, leading, end, layout }: Beginning,
): EarlyDecoder | null {
  if (header.method !== REEL) return null;
  let decoder: BlockDecoder | null = null;
  try {
    decoder = new BlockDecoder(core, header, leading);
    decoder.prepare(layout);
    return { decoder, end };
  } catch {
    decoder?.close();
    return null;
  }
}
