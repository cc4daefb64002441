// Caches the blocks around the current time: at most two blocks, loaded one at a time.

import type { LoadedBlock } from "./loaded_block.js";

/** Limit of cached blocks. */
export const MAX_BLOCKS = 2;

/** A block in the order of playback. */
export interface CachedBlock {
  loaded: LoadedBlock | null;
  /** Whether loading failed; it is not requested again until `retry`. */
  hasFailed: boolean;
  /** Whether it is damaged; it is never requested again. */
  isDamaged: boolean;
}

/** What a cache calls. */
export interface BlockHandlers<Block> {
  /** Load a block; the signal is aborted when the block is no longer requested. */
  load(block: Block, signal: AbortSignal): Promise<LoadedBlock>;
  /** Free the resources of a block that is evicted. */
  release(block: Block, loaded: LoadedBlock): void;
  /** Called when a block is loaded; must call `request` again. */
  onLoaded(): void;
  /** Called when a block fails to load; must call `request` again. */
  onError(block: Block, error: Error): void;
}

/** Loads requested blocks and evicts all others. */
export class BlockCache<Block extends CachedBlock> {
  readonly #blocks: readonly Block[];
  readonly #handlers: BlockHandlers<Block>;
  #loading: { block: Block; abort: AbortController } | null = null;

  /** @param blocks - all blocks; the array may change */
  constructor(blocks: readonly Block[], handlers: BlockHandlers<Block>) {
    this.#blocks = blocks;
    this.#handlers = handlers;
  }

  /** Whether a requested block is being loaded. */
  get isLoading(): boolean {
    return this.#loading !== null;
  }

  /** Load up to `MAX_BLOCKS` blocks by descending priority, and evict all others. */
  request(wanted: readonly Block[]): void {
    for (const block of this.#blocks) {
      if (!block.loaded || wanted.includes(block)) continue;
      this.#handlers.release(block, block.loaded);
      block.loaded = null;
    }
    const missing = wanted.find((block) => !(block.loaded || block.hasFailed || block.isDamaged));
    if (this.#loading && this.#loading.block !== missing) {
      this.#loading.abort.abort();
      this.#loading = null;
    }
    if (missing && !this.#loading) void this.#start(missing);
  }

  /** Allow blocks that failed to load to be requested again, except for damaged ones. */
  retry(): void {
    for (const block of this.#blocks) block.hasFailed = false;
  }

  async #start(block: Block): Promise<void> {
    const abort = new AbortController();
    this.#loading = { block, abort };
    let loaded: LoadedBlock;
    try {
      loaded = await this.#handlers.load(block, abort.signal);
    } catch (thrown) {
      if (abort.signal.aborted) return;
      this.#loading = null;
      const error = thrown instanceof Error ? thrown : new Error(String(thrown));
      block.hasFailed = true;
      block.isDamaged = isDamageError(error);
      return this.#handlers.onError(block, error);
    }
    if (abort.signal.aborted) return this.#handlers.release(block, loaded);
    this.#loading = null;
    block.loaded = loaded;
    this.#handlers.onLoaded();
  }
}

/** Whether bytes are damaged. Compares names: a page may load the error classes once per entry point. */
export function isDamageError(error: Error): boolean {
  return /^(Corrupt|Truncated)StreamError$/.test(error.name);
}
