// Caches the blocks around the current time: at most two blocks, loaded one at a time.

/** Limit of cached blocks. */
export const MAX_BLOCKS = 2;

/** What a cache calls. */
export interface BlockHandlers<Block> {
  /** Load a block; the signal is aborted when the block is no longer requested. */
  load(number: number, signal: AbortSignal): Promise<Block>;
  /** Free the resources of a block that is evicted. */
  release(block: Block): void;
  /** Called when a block is loaded; must call `request` again. */
  onLoaded(): void;
  /** Called when a block fails to load; must call `request` again. */
  onError(number: number, error: Error): void;
}

/** Loads requested blocks and evicts all others. */
export class BlockCache<Block> {
  readonly #handlers: BlockHandlers<Block>;
  readonly #blocks = new Map<number, Block>();
  readonly #damaged = new Set<number>();
  readonly #failed = new Set<number>();
  #loading: { number: number; abort: AbortController } | null = null;

  constructor(handlers: BlockHandlers<Block>) {
    this.#handlers = handlers;
  }

  /** Return a block if it is loaded. */
  get(number: number): Block | undefined {
    return this.#blocks.get(number);
  }

  /** Whether a block is damaged; it is never requested again. */
  isDamaged(number: number): boolean {
    return this.#damaged.has(number);
  }

  /** Whether a requested block is being loaded. */
  get isLoading(): boolean {
    return this.#loading !== null;
  }

  /** Load up to `MAX_BLOCKS` blocks by descending priority, and evict all others. */
  request(numbers: readonly number[]): void {
    for (const [number, block] of this.#blocks) {
      if (numbers.includes(number)) continue;
      this.#blocks.delete(number);
      this.#handlers.release(block);
    }
    const missing = numbers.find((one) => ![this.#blocks, this.#damaged, this.#failed].some((known) => known.has(one)));
    if (this.#loading && this.#loading.number !== missing) {
      this.#loading.abort.abort();
      this.#loading = null;
    }
    if (missing !== undefined && !this.#loading) void this.#start(missing);
  }

  /** Allow blocks that failed to load to be requested again, except for damaged ones. */
  retry(): void {
    this.#failed.clear();
  }

  async #start(number: number): Promise<void> {
    const abort = new AbortController();
    this.#loading = { number, abort };
    let block: Block;
    try {
      block = await this.#handlers.load(number, abort.signal);
    } catch (thrown) {
      if (abort.signal.aborted) return;
      this.#loading = null;
      const error = thrown instanceof Error ? thrown : new Error(String(thrown));
      (isDamageError(error) ? this.#damaged : this.#failed).add(number);
      return this.#handlers.onError(number, error);
    }
    if (abort.signal.aborted) return this.#handlers.release(block);
    this.#loading = null;
    this.#blocks.set(number, block);
    this.#handlers.onLoaded();
  }
}

// Compares names, since a page may load the error classes twice, once per entry point.
function isDamageError(error: Error): boolean {
  return /^(Corrupt|Truncated)StreamError$/.test(error.name);
}
