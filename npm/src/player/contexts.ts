// The contexts of WebGL that players of a page hold: browsers keep about 16, and take the oldest.

/** Contexts that players hold at once; a few are left for the rest of the page. */
const MOST_CONTEXTS = 14;

/** Who holds a context. */
export interface ContextHolder {
  /** Whether it can be seen, so that it needs its context. */
  readonly isSeen: boolean;
  /** Gives the context back, until it is seen again. */
  rest(): void;
}

/** Those that were seen last are the last. */
const holders = new Set<ContextHolder>();

/**
 * Takes a context for a holder; where there are too many, one that is not seen gives its own back.
 * Where all are seen, the browser decides whose context is lost.
 */
export function takeContext(holder: ContextHolder): void {
  holders.delete(holder);
  const unseen = [...holders].find(({ isSeen }) => !isSeen);
  if (holders.size >= MOST_CONTEXTS && unseen) {
    giveContextBack(unseen);
    unseen.rest();
  }
  holders.add(holder);
}

/** The holder has no context any more. */
export function giveContextBack(holder: ContextHolder): void {
  holders.delete(holder);
}
