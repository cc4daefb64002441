// Shares open files between the players of a page.

import { SegmentedReelFile } from "../index.js";
import type { SourceInput } from "../source/transport.js";

interface Shared {
  readonly opening: Promise<SegmentedReelFile>;
  readonly aborting: AbortController;
  nUsers: number;
}

/** Open files by address, or by the object that contains the bytes. */
const shared = new Map<SourceInput, Shared>();

/** An open file, and the function that releases it. */
export interface SharedReel {
  readonly file: SegmentedReelFile;
  release(): void;
}

/**
 * Open a file, or return the one that other players have opened: they share its worker, its cached
 * bytes and its two decoded blocks. It is closed when its last user releases it.
 *
 * @throws like `SegmentedReelFile.open`, for all callers that wait for it; the next call tries again.
 */
export async function openShared(source: SourceInput, signal: AbortSignal): Promise<SharedReel> {
  const address = typeof source === "string" ? new URL(source, document.baseURI).href : source;
  const found = shared.get(address) ?? startOpening(address);
  found.nUsers++;
  let isReleased = false;
  const release = (): void => {
    if (isReleased) return;
    isReleased = true;
    if (--found.nUsers > 0) return;
    if (shared.get(address) === found) shared.delete(address);
    found.aborting.abort();
    found.opening.then((file) => file.close()).catch(() => {});
  };
  signal.addEventListener("abort", release);
  try {
    return { file: await found.opening, release };
  } catch (error) {
    if (shared.get(address) === found) shared.delete(address);
    release();
    throw error;
  } finally {
    signal.removeEventListener("abort", release);
  }
}

function startOpening(address: SourceInput): Shared {
  const aborting = new AbortController();
  const { signal } = aborting;
  const opened = { opening: SegmentedReelFile.open(address, { signal }), aborting, nUsers: 0 };
  opened.opening.catch(() => {}); // callers that wait for it handle the error
  shared.set(address, opened);
  return opened;
}
