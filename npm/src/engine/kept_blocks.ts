// Decoded blocks of a track: two are kept, and the next is decoded ahead while frames are played.

/** Decoded blocks that are kept: the one that is played, and the next. */
const MOST_BLOCKS = 2;

/** A decoded block; `close` gives its memory back. */
export interface ClosableBlock {
  readonly number: number;
  close(): void;
}

/** Gets all that a block needs; what comes decodes it. */
export type Prepare<Block> = (number: number, signal: AbortSignal) => Promise<() => Block>;

export class KeptBlocks<Block extends ClosableBlock> {
  /** The one used last is the last. */
  private blocks: Block[] = [];
  /** Those on their way. */
  private readonly pending = new Map<number, Promise<Block>>();
  private lastFrame = -1;
  /** Whether the last frames were asked for in order. */
  private isPlayed = false;

  /** @param starts - First frame of each block, and the number of all frames. */
  constructor(
    private readonly starts: readonly number[],
    private readonly prepare: Prepare<Block>,
  ) {}

  /**
   * The block of a frame, which has to be there, and the number of the frame within it.
   *
   * @param count - Frames of the block from there on that are asked for.
   */
  async ofFrame(number: number, signal: AbortSignal, count = 1): Promise<[Block, number]> {
    const block = this.starts.findLastIndex((start) => start <= number);
    this.isPlayed = number === this.lastFrame + 1;
    this.lastFrame = number + count - 1;
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
  async block(number: number, signal: AbortSignal): Promise<Block> {
    const kept = this.blocks.find((block) => block.number === number);
    const found = kept ?? (await (this.pending.get(number) ?? this.begin(number, signal)));
    signal.throwIfAborted();
    this.blocks = [...this.blocks.filter((block) => block !== found), found];
    return found;
  }

  private begin(number: number, signal: AbortSignal): Promise<Block> {
    const found = this.decoded(number, signal).finally(() => this.pending.delete(number));
    this.pending.set(number, found);
    return found;
  }

  private async decoded(number: number, signal: AbortSignal): Promise<Block> {
    const decode = await this.prepare(number, signal);
    signal.throwIfAborted();
    while (this.blocks.length >= MOST_BLOCKS) this.blocks.shift()!.close();
    const found = decode();
    this.blocks.push(found);
    return found;
  }
}
