// The blocks around the time: at most two are held, one is loaded at a time.

/** The most blocks that are held. */
export const MOST_HELD = 2;

/** Blocks by number, the wanted ones of which are loaded, and all others let go. */
export class BlockWindow<Block> {
  readonly #load: (number: number, signal: AbortSignal) => Promise<Block>;
  readonly #release: (block: Block) => void;
  readonly #onHeld: () => void;
  readonly #onError: (number: number, error: Error) => void;
  readonly #held = new Map<number, Block>();
  readonly #damaged = new Set<number>();
  readonly #failed = new Set<number>();
  #loading: { number: number; abort: AbortController } | null = null;

  /**
   * @param load - gives a block, or throws; its signal is aborted when the block is not wanted
   * @param release - frees what a block holds beyond memory
   * @param onHeld - is told when another block is there, and says again what is wanted
   * @param onError - is told of a block that cannot be had, and says again what is wanted
   */
  constructor(
    load: (number: number, signal: AbortSignal) => Promise<Block>,
    release: (block: Block) => void,
    onHeld: () => void,
    onError: (number: number, error: Error) => void,
  ) {
    this.#load = load;
    this.#release = release;
    this.#onHeld = onHeld;
    this.#onError = onError;
  }

  /** The block if it is here. */
  get(number: number): Block | undefined {
    return this.#held.get(number);
  }

  /** Whether the bytes of a block are damaged, so that it will never be there. */
  isDamaged(number: number): boolean {
    return this.#damaged.has(number);
  }

  /** Has up to `MOST_HELD` blocks loaded, the first of them first, and no others. */
  want(numbers: readonly number[]): void {
    for (const [number, block] of this.#held) {
      if (!numbers.includes(number)) this.#letGo(number, block);
    }
    const missing = numbers.find((number) => this.#isMissing(number));
    if (this.#loading && this.#loading.number !== missing) this.#abort();
    if (missing !== undefined && !this.#loading) void this.#start(missing);
  }

  /** Tries again what could not be had for another reason than damage. */
  retry(): void {
    this.#failed.clear();
  }

  /** Lets all blocks go, and aborts loading. */
  clear(): void {
    this.#abort();
    for (const [number, block] of this.#held) this.#letGo(number, block);
  }

  #isMissing(number: number): boolean {
    return !this.#held.has(number) && !this.#damaged.has(number) && !this.#failed.has(number);
  }

  #letGo(number: number, block: Block): void {
    this.#held.delete(number);
    this.#release(block);
  }

  #abort(): void {
    this.#loading?.abort.abort();
    this.#loading = null;
  }

  async #start(number: number): Promise<void> {
    const abort = new AbortController();
    this.#loading = { number, abort };
    let block: Block;
    try {
      block = await this.#load(number, abort.signal);
    } catch (thrown) {
      if (abort.signal.aborted) return;
      this.#loading = null;
      const error = thrown instanceof Error ? thrown : new Error(String(thrown));
      (isDamage(error) ? this.#damaged : this.#failed).add(number);
      return this.#onError(number, error);
    }
    if (abort.signal.aborted) return this.#release(block);
    this.#loading = null;
    this.#held.set(number, block);
    this.#onHeld();
  }
}

// By name: a page may hold this class twice, once in each module of the package.
function isDamage(error: Error): boolean {
  return /^(Corrupt|Truncated)StreamError$/.test(error.name);
}
