// Shares the bytes of an address among players.

import { SourceError } from "../errors.js";
import type { ByteSource } from "../types.js";
import { openRemote, untilAborted } from "./remote.js";

/** Bytes that stay in memory for other players: those read last. */
const KEPT_BYTES = 2 ** 23;

/** A source that is open or opening. */
interface SharedSource {
  readonly opening: Promise<ByteSource>;
  readonly controller: AbortController;
  nUsers: number;
}

/** Sources by address. */
const sources = new Map<string, SharedSource>();

/**
 * Open an address as `openSource`; all that use it at the same time share its bytes and the version
 * of the file, as images of a page do. It is closed when all have closed it. After an error it is
 * opened again for later users, since the file may have changed.
 */
export async function openShared(address: string, signal: AbortSignal): Promise<ByteSource> {
  signal.throwIfAborted();
  const shared = sources.get(address) ?? openNew(address);
  shared.nUsers += 1;
  let isOpen = true;
  const close = (): void => {
    if (!isOpen) return;
    isOpen = false;
    if (--shared.nUsers > 0) return;
    forget(address, shared);
    shared.controller.abort();
  };
  const failed = (error: unknown): never => {
    if (error instanceof SourceError) forget(address, shared);
    throw error;
  };
  const source = await untilAborted(shared.opening, signal).catch((error: unknown) => {
    close();
    return failed(error);
  });
  const read: ByteSource["read"] = (...range) => source.read(...range).catch(failed);
  return Object.assign(Object.create(source), { read, close });
}

function openNew(address: string): SharedSource {
  const controller = new AbortController();
  const { signal } = controller;
  const opening = openRemote(address, { cache: "no-store" }, { signal }, KEPT_BYTES);
  const shared = { opening, controller, nUsers: 0 };
  sources.set(address, shared);
  return shared;
}

function forget(address: string, shared: SharedSource): void {
  if (sources.get(address) === shared) sources.delete(address);
}
