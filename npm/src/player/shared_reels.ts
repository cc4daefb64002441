// Files that several players of a page show: each is opened once.

import { ReelFile } from "../index.js";

interface Shared {
  readonly opening: Promise<ReelFile>;
  readonly aborting: AbortController;
  nUsers: number;
}

/** By address. */
const shared = new Map<string, Shared>();

/** A file that is open, and what a player calls once it needs it no more. */
export interface SharedReel {
  readonly reel: ReelFile;
  release(): void;
}

/**
 * Opens a file, or joins the players that have it open: they share its worker, its first bytes and
 * its two decoded blocks. The last one that releases it closes it.
 *
 * @throws what `ReelFile.open` throws, to all that wait for it; the next call tries again.
 */
export async function openShared(src: string, signal: AbortSignal): Promise<SharedReel> {
  const address = new URL(src, document.baseURI).href;
  const found = shared.get(address) ?? begin(address);
  found.nUsers++;
  let isReleased = false;
  const release = (): void => {
    if (isReleased) return;
    isReleased = true;
    if (--found.nUsers > 0) return;
    if (shared.get(address) === found) shared.delete(address);
    found.aborting.abort();
    found.opening.then((reel) => reel.close()).catch(() => {});
  };
  signal.addEventListener("abort", release);
  try {
    return { reel: await found.opening, release };
  } catch (error) {
    if (shared.get(address) === found) shared.delete(address);
    release();
    throw error;
  } finally {
    signal.removeEventListener("abort", release);
  }
}

function begin(address: string): Shared {
  const aborting = new AbortController();
  const { signal } = aborting;
  const opened = { opening: ReelFile.open(address, { signal }), aborting, nUsers: 0 };
  opened.opening.catch(() => {}); // those who wait for it get it
  shared.set(address, opened);
  return opened;
}
