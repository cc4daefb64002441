// An open `.reel` file that decodes frames on request.

import { CorruptStreamError, InvalidInputError } from "../errors.js";
import type { Results } from "../engine/messages.js";
import { requireIndex, valuesIn } from "./arguments.js";
import type { SourceInput } from "../source/transport.js";
import type {
  BlockFields,
  CutPlane,
  OpenReel,
  Positions,
  ReelInfo,
  Surface,
} from "../types.js";
import { FileEngines, type FileOptions } from "./engines.js";
import { type CallOptions, ReelTrack } from "./reel_track.js";

const POSITION_COLUMNS = [0, 1, 2];

/** Options of `ReelFile.open`. */
export interface OpenOptions extends FileOptions {
  /**
   * Index of the segment to open, for files with several segments: meshes of different
   * connectivity, played in order. Frames of a segment are counted from 0. Opening such a file
   * without it throws an error that contains the number of segments; `SegmentedReelFile` opens all
   * of them.
   */
  segment?: number;
}

/**
 * An open `.reel` file.
 *
 * Opening reads the connectivity and the index; blocks of frames are read when they are needed, and
 * the last two decoded blocks are cached. Positions are bit-identical to those of the Python
 * package.
 *
 * @example
 * const reel = await ReelFile.open("walk.reel");
 * const positions = await reel.frame(10); // x, y, z of each vertex
 * reel.close();
 */
export class ReelFile implements OpenReel {
  /** Images that have been read, by index. */
  private readonly images = new Map<number, Uint8Array>();

  private constructor(
    private readonly engines: FileEngines,
    private readonly index: number | null,
    private readonly ownsEngines: boolean,
    readonly info: ReelInfo,
    /** Triangles, attributes, groups and materials: all that frames share. */
    readonly surface: Surface,
  ) {}

  /**
   * Open a file.
   *
   * @param from - A `.reel`, or an MP4 file that contains one: an address, read by range requests; a
   *   blob, such as a dropped file; or bytes, such as a `Buffer` of Node, which are copied.
   * @throws SourceError if the bytes cannot be read.
   * @throws CorruptStreamError, TruncatedStreamError if the file is damaged or not a `.reel` file. A
   *   file that is damaged only at its end still opens; `info.damage` has the reason.
   * @throws UnsupportedVersionError if the file needs a newer version, or a method that only the
   *   Python package decodes.
   * @throws MemoryLimitError if the mesh needs more than `memory`; decoding a block can throw it too.
   * @throws WebAssembly.CompileError if the Content-Security-Policy forbids WebAssembly; it must
   *   allow `script-src 'wasm-unsafe-eval'`.
   */
  static async open(from: SourceInput, options: OpenOptions = {}): Promise<ReelFile> {
    const { segment = null } = options;
    if (segment !== null && !(Number.isInteger(segment) && segment >= 0)) {
      throw new InvalidInputError(`segment must be a non-negative integer; got ${segment}`);
    }
    const { engines, opened } = await FileEngines.open(from, options, segment);
    return new ReelFile(engines, segment, true, opened.info, opened.surface);
  }

  /**
   * Return a segment of a `SegmentedReelFile`.
   *
   * @internal
   */
  static segment(engines: FileEngines, index: number, { info, surface }: Results["open"]): ReelFile {
    return new ReelFile(engines, index, false, info, surface);
  }

  /**
   * Decode the positions of a frame, of shape (V, 3) in model units: float32 or float64, as encoded.
   *
   * @param index - Frame, counted from 0.
   * @param target - An array to reuse, such as that of an earlier frame: it is filled and returned. If
   *   the call fails, it keeps its values.
   * @throws InvalidInputError if there is no such frame, or `target` has another type or length.
   * @throws CorruptStreamError if its block is damaged; frames of other blocks can be decoded.
   * @throws SourceError if the bytes cannot be read.
   */
  async frame(index: number, target?: Positions | null, { signal }: CallOptions = {}): Promise<Positions> {
    requireIndex("frame", index, this.info.nFrames);
    const call = { segment: this.index, track: 0, frame: index };
    return valuesIn(target, await this.engines.positions.call("frame", call, signal)) as Positions;
  }

  /**
   * Return a track by name. Its values are decoded on request.
   *
   * A separate worker decodes tracks. It starts when values are first requested, and never delays
   * positions. Only bytes of requested tracks are read.
   *
   * @example
   * const stress = reel.track("stress");
   * const values = await stress.frame(10); // stress.info.nItems x stress.info.nColumns
   *
   * @throws InvalidInputError if the file has no track of this name.
   * @throws CorruptStreamError if two tracks of the file have the same name.
   */
  track(name: string): ReelTrack {
    const { tracks } = this.info;
    const index = tracks.findIndex((track) => track.name === name);
    if (index < 0) {
      const names = tracks.map((track) => JSON.stringify(track.name)).join(", ") || "none";
      throw new InvalidInputError(`there is no track ${JSON.stringify(name)}; available: ${names}`);
    }
    if (new Set(tracks.map((track) => track.name)).size < tracks.length) {
      throw new CorruptStreamError("two tracks of the file have the same name");
    }
    return new ReelTrack(this.info, index, this.index, () => this.engines.ofTracks(this.index));
  }

  /**
   * Decode a block of frames to 16-bit fields and weights, for shaders.
   *
   * @param block - Index in `info.blocks`.
   * @throws InvalidInputError, CorruptStreamError, SourceError as `frame`.
   */
  async fields(block: number, { signal }: CallOptions = {}): Promise<BlockFields> {
    requireIndex("block", block, this.info.blocks.length);
    const call = { segment: this.index, track: 0, block, columns: POSITION_COLUMNS };
    return this.engines.positions.call("fields", call, signal);
  }

  /**
   * Return the surface of a volume mesh without the cells beyond a plane, so that the inside is
   * visible. A cell is left out if, in the first frame, the dot product of its center, the mean of its
   * nodes, and `normal` exceeds `offset`. Only attributes of vertices and cells remain.
   *
   * @throws InvalidInputError if the mesh has no cells, or all of them are beyond the plane.
   * @throws CorruptStreamError, SourceError as `frame`.
   */
  async cut(plane: CutPlane, { signal }: CallOptions = {}): Promise<Surface> {
    const { surface, index: segment } = this;
    const { cells } = surface;
    if (!cells) throw new InvalidInputError("only volume meshes can be cut; this file has no cells");
    const { triangles, faceSizes, faceCells } = await this.engines.positions.call("cut", { segment, plane }, signal);
    if (!triangles.length) throw new InvalidInputError("all cells are beyond the plane");
    let corner = 0;
    const triangleCorners = Uint32Array.from(
      Array.from(faceSizes, (size) => {
        const first = (corner += size) - size;
        return Array.from({ length: size - 2 }, (_, i) => [first, first + i + 1, first + i + 2]);
      }).flat(2),
    );
    return {
      ...surface,
      ...{ triangles, faceSizes, triangleCorners, hardEdges: null, groups: [] },
      attributes: surface.attributes.filter(({ domain }) => domain === "vertex" || domain === "cell"),
      cells: { ...cells, faceCells },
    };
  }

  /**
   * Read an image of a material; opening a file does not read images. The bytes stay in memory and
   * must not be changed.
   *
   * @param index - Index in `surface.images`.
   * @throws InvalidInputError if there is no such image.
   * @throws CorruptStreamError if it is damaged; the rest can be decoded.
   * @throws SourceError if the bytes cannot be read.
   */
  async image(index: number, { signal }: CallOptions = {}): Promise<Uint8Array> {
    requireIndex("image", index, this.surface.images.length);
    const call = { segment: this.index, image: index };
    const bytes = this.images.get(index) ?? (await this.engines.positions.call("image", call, signal));
    this.images.set(index, bytes);
    return bytes;
  }

  /** Whether a worker decodes frames, rather than the calling thread. */
  get isInWorker(): boolean {
    return this.engines.positions.isInWorker;
  }

  /**
   * Release all memory and connections. Pending calls throw an `AbortError`. Segments of a
   * `SegmentedReelFile` stay open until that is closed.
   */
  close(): void {
    if (this.ownsEngines) this.engines.close();
  }
}
