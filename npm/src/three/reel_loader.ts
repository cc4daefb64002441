// A loader in the style of three.js.

import * as THREE from "three";

import { SegmentedReelFile } from "../index.js";
import { ReelMesh, type ReelMeshOptions } from "./reel_mesh.js";

/** Options of a `ReelLoader`, which are passed to its meshes. */
export type ReelLoaderOptions = Omit<ReelMeshOptions, "ownsReel">;

/**
 * Loads a file as a `ReelMesh`, which resolves once the surface is decoded. Blocks of frames are
 * loaded during playback. `dispose()` of the mesh closes the file.
 */
export class ReelLoader extends THREE.Loader<ReelMesh> {
  readonly #options: ReelLoaderOptions;

  /**
   * @param manager - tracks what is being loaded
   * @param options - options of the meshes
   */
  constructor(manager?: THREE.LoadingManager, options: ReelLoaderOptions = {}) {
    super(manager);
    this.#options = options;
  }

  /** Load a file. There are no progress events, since blocks are loaded during playback. */
  override load(
    url: string,
    onLoad: (mesh: ReelMesh) => void,
    _onProgress?: (event: ProgressEvent) => void,
    onError: (error: unknown) => void = console.error,
  ): void {
    const { manager } = this;
    const address = manager.resolveURL(THREE.LoaderUtils.resolveURL(url, this.path));
    manager.itemStart(url);
    this.#open(address)
      .then(onLoad)
      .catch((error: unknown) => {
        onError(error);
        manager.itemError(url);
      })
      .finally(() => manager.itemEnd(url));
  }

  /**
   * Create the mesh of a file in memory.
   *
   * @throws like `SegmentedReelFile.open`
   */
  parse(data: ArrayBuffer): Promise<ReelMesh> {
    return this.#open(data);
  }

  async #open(source: string | ArrayBuffer): Promise<ReelMesh> {
    const reel = await SegmentedReelFile.open(source, {
      headers: this.requestHeader,
      credentials: this.withCredentials ? "include" : "same-origin",
    });
    try {
      return new ReelMesh(reel, { ...this.#options, ownsReel: true });
    } catch (error) {
      reel.close();
      throw error;
    }
  }
}
