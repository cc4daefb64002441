// Decoded blocks of a track: two are kept, and the next is decoded ahead while frames are played.

import type { BlockDecoder } from "../decode/block_decoder.js";
import type { DecodedBlock } from "../decode/decoded_block.js";
import type { StoredBlock } from "../stream/block_sections.js";

/** Decoded blocks that are kept: the one that is played, and the next. */
const MOST_BLOCKS = 2;

export class KeptBlocks {
  /** The one used last is the last. */
  private blocks: DecodedBlock[] = [];
  /** Those on their way. */
  private readonly pending = new Map<number, Promise<DecodedBlock>>();
  private lastFrame = -1;
  /** Whether the last frames were asked for in order. */
  private isPlayed = false;

  /**
   * @param starts - First frame of each block, and the number of all frames.
   * @param stored - Reads a block.
   */
  constructor(
    private readonly decoder: BlockDecoder,
    private readonly starts: readonly number[],
    private readonly stored: (number: number, signal: AbortSignal) => Promise<StoredBlock>,
  ) {}

  /** The block of a frame, which has to be there, and the number of the frame within it. */
  async ofFrame(number: number, signal: AbortSignal): Promise<[DecodedBlock, number]> {
    const block = this.starts.findLastIndex((start) => start <= number);
    this.isPlayed = number === this.lastFrame + 1;
    this.lastFrame = number;
    return [await this.block(block, signal), number - this.starts[block]];
  }

  /**
   * Decodes the next block, where frames are asked for in order and are in the second half of one.
   *
   * What goes wrong is told when a frame of the block is asked for.
   */
  async goAhead(): Promise<void> {
    const { starts } = this;
    const next = starts.findLastIndex((start) => start <= this.lastFrame) + 1;
    const isNear = 2 * this.lastFrame >= starts[next - 1] + starts[next];
    const isDecoded = this.blocks.some((block) => block.number === next);
    const isThere = next < starts.length - 1;
    if (!this.isPlayed || !isNear || isDecoded || this.pending.size || !isThere) return;
    await this.block(next, new AbortController().signal).catch(() => {});
  }

  /** A block: kept from before, on its way, or decoded now. */
  async block(number: number, signal: AbortSignal): Promise<DecodedBlock> {
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
}
