// Limits the number of WebGL contexts of a page: browsers allow about 16, then drop the oldest.

/** Contexts that players hold at most; a few are left to the rest of the page. */
const MAX_CONTEXTS = 14;

/** An object that holds a context. */
export interface ContextHolder {
  /** Whether it is visible, and therefore needs its context. */
  readonly isVisible: boolean;
  /** Release the context until the holder is visible again. */
  suspend(): void;
}

/** Ordered by the time they were last visible. */
const holders = new Set<ContextHolder>();

/**
 * Register the context of a holder. If there are too many, suspend a holder that is not visible; if
 * all are visible, the browser decides which context is lost.
 */
export function acquireContext(holder: ContextHolder): void {
  holders.delete(holder);
  const hidden = [...holders].find(({ isVisible }) => !isVisible);
  if (holders.size >= MAX_CONTEXTS && hidden) {
    releaseContext(hidden);
    hidden.suspend();
  }
  holders.add(holder);
}

/** Unregister the context of a holder. */
export function releaseContext(holder: ContextHolder): void {
  holders.delete(holder);
}
