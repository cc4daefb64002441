// A least-recently-used cache with asynchronous loading.

/** Loads values by index and caches the most recently used ones. */
export class Cache<T> {
  private readonly entries = new Map<number, T>();
  private readonly loading = new Map<number, Promise<T>>();

  constructor(
    private readonly fetch: (index: number) => Promise<T>,
    private readonly capacity: number,
  ) {}

  /** Number of values that are being loaded. */
  get nLoading(): number {
    return this.loading.size;
  }

  /** Return a value if it is cached. */
  peek(index: number): T | undefined {
    const value = this.entries.get(index);
    if (value !== undefined) this.touch(index, value);
    return value;
  }

  hasOrLoads(index: number): boolean {
    return this.entries.has(index) || this.loading.has(index);
  }

  /** Return a value, loading it if necessary; concurrent calls load it once. */
  async load(index: number): Promise<T> {
    const cached = this.peek(index);
    if (cached !== undefined) return cached;
    const promise = this.loading.get(index) ?? this.start(index);
    return promise;
  }

  private start(index: number): Promise<T> {
    const promise = this.fetch(index)
      .then((value) => {
        this.touch(index, value);
        this.trim();
        return value;
      })
      .finally(() => this.loading.delete(index));
    this.loading.set(index, promise);
    return promise;
  }

  private touch(index: number, value: T): void {
    this.entries.delete(index);
    this.entries.set(index, value);
  }

  private trim(): void {
    for (const index of this.entries.keys()) {
      if (this.entries.size <= this.capacity) return;
      this.entries.delete(index);
    }
  }
}
