// Things that are loaded by number, each once, the latest used of which are kept.

export class Cache<T> {
  private readonly kept = new Map<number, T>();
  private readonly loading = new Map<number, Promise<T>>();

  /** Keeps up to `capacity` things; `discard` frees what one holds beyond memory. */
  constructor(
    private readonly fetch: (number: number) => Promise<T>,
    private readonly capacity: number,
    private readonly discard: (thing: T) => void = () => {},
  ) {}

  /** How many are on their way. */
  get nLoading(): number {
    return this.loading.size;
  }

  /** The thing if it is here. */
  peek(number: number): T | undefined {
    const thing = this.kept.get(number);
    if (thing !== undefined) this.touch(number, thing);
    return thing;
  }

  isKnown(number: number): boolean {
    return this.kept.has(number) || this.loading.has(number);
  }

  /** The thing, fetched if need be; asking twice fetches once. */
  async load(number: number): Promise<T> {
    const here = this.peek(number);
    if (here !== undefined) return here;
    const coming = this.loading.get(number) ?? this.start(number);
    return coming;
  }

  private start(number: number): Promise<T> {
    const coming = this.fetch(number)
      .then((thing) => {
        this.touch(number, thing);
        this.trim();
        return thing;
      })
      .finally(() => this.loading.delete(number));
    this.loading.set(number, coming);
    return coming;
  }

  private touch(number: number, thing: T): void {
    this.kept.delete(number);
    this.kept.set(number, thing);
  }

  private trim(): void {
    for (const [number, thing] of this.kept) {
      if (this.kept.size <= this.capacity) return;
      this.kept.delete(number);
      this.discard(thing);
    }
  }
}
