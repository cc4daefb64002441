// Loads files as three.js does.

import * as THREE from "three";

import { ReelFile } from "../index.js";
import { ReelMesh, type ReelMeshOptions } from "./reel_mesh.js";

/** Options of a `ReelLoader`: those of its meshes. */
export type ReelLoaderOptions = Omit<ReelMeshOptions, "ownsReel">;

/**
 * Loads a file as a `ReelMesh`, as soon as its surface is known: blocks of frames come while it
 * plays, and with them the event "frame". `dispose()` of the mesh closes the file.
 */
export class ReelLoader extends THREE.Loader<ReelMesh> {
  readonly #options: ReelLoaderOptions;

  /**
   * @param manager - that tells of what is loaded
   * @param options - of the meshes
   */
  constructor(manager?: THREE.LoadingManager, options: ReelLoaderOptions = {}) {
    super(manager);
    this.#options = options;
  }

  /** Loads a file; progress is not told, for it comes in parts as it plays. */
  override load(
    url: string,
    onLoad: (mesh: ReelMesh) => void,
    _onProgress?: (event: ProgressEvent) => void,
    onError?: (error: unknown) => void,
  ): void {
    const { manager } = this;
    const address = manager.resolveURL(THREE.LoaderUtils.resolveURL(url, this.path));
    manager.itemStart(url);
    this.#opened(address)
      .then(onLoad)
      .catch((error: unknown) => {
        if (onError) onError(error);
        else console.error(error);
        manager.itemError(url);
      })
      .finally(() => manager.itemEnd(url));
  }

  /**
   * The mesh of a file in memory.
   *
   * @throws what `ReelFile.open` throws
   */
  parse(data: ArrayBuffer): Promise<ReelMesh> {
    return this.#opened(data);
  }

  async #opened(source: string | ArrayBuffer): Promise<ReelMesh> {
    const reel = await ReelFile.open(source, {
      headers: this.requestHeader,
      credentials: this.withCredentials ? "include" : "same-origin",
    });
    return new ReelMesh(reel, { ...this.#options, ownsReel: true });
  }
}
