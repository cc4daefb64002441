// A stream that is in memory as a whole, decoded on the spot.

import type { Core } from "../../src/core/core.js";
import { InvalidInputError } from "../../src/errors.js";
import { type StoredBlock, readBlock } from "../../src/stream/block_sections.js";
import { type Stream, readStream } from "../../src/stream/stream.js";
import { readSurface } from "../../src/surface/surface.js";
import type { BlockFields, ReelInfo, Surface } from "../../src/types.js";
import { BlockDecoder, POSITION_COLUMNS } from "../../src/decode/block_decoder.js";
import { fieldsOf } from "../../src/decode/block_fields.js";
import { type Connectivity, decodeConnectivity } from "../../src/decode/connectivity.js";
import type { DecodedBlock } from "../../src/decode/decoded_block.js";
import { type Positions, frameOf } from "../../src/decode/frames.js";
import { readInfo } from "../../src/decode/info.js";
import { Items } from "../../src/decode/items.js";
import { readTracks } from "../../src/decode/track_infos.js";

/** A whole `.reel`: all calls return once they are done. */
export class MemoryReel {
  private readonly facts: Omit<ReelInfo, "tracks">;
  private readonly stream: Stream;
  private readonly mesh: Items<Connectivity>;
  private readonly decoder: BlockDecoder;
  private foundSurface: Surface | null = null;

  /**
   * Reads header, connectivity and index. Of a stream whose end is missing, it holds the blocks
   * that are complete.
   *
   * @param core - As `loadCore` gives it; several streams may share it.
   * @param bytes - The file, which must not change while the reel is in use.
   * @throws CorruptStreamError, TruncatedStreamError where the bytes are no `.reel`, or damaged.
   * @throws UnsupportedVersionError where a newer build is needed, or the method is not `reel`.
   */
  constructor(
    private readonly core: Core,
    private readonly bytes: Uint8Array,
  ) {
    this.stream = readStream(bytes);
    this.facts = readInfo(this.stream);
    this.mesh = new Items(core, decodeConnectivity(core, this.stream.header, this.stream.leading));
    this.decoder = new BlockDecoder(this.mesh, POSITION_COLUMNS);
  }

  get info(): ReelInfo {
    return { ...this.facts, tracks: readTracks(this.stream, this.surface.faceSizes) };
  }

  /** What the mesh is beside its positions. @throws CorruptStreamError where it is damaged. */
  get surface(): Surface {
    const { leading, header } = this.stream;
    const { triangles } = this.mesh.graph;
    this.foundSurface ??= readSurface(this.core, leading, triangles, header.nVerts);
    return this.foundSurface;
  }

  /**
   * A block, decoded; it takes memory until it is closed.
   *
   * @throws InvalidInputError where there is none of this number.
   * @throws CorruptStreamError where it, or the block that it refers to, is damaged.
   */
  decodeBlock(number: number): DecodedBlock {
    return this.decoder.decode(this.stored(number), (key) => this.stored(key));
  }

  /** Positions of a frame of a block, as `frameOf` of decode/frames.ts. */
  frameOf(block: DecodedBlock, time: number, into?: Positions): Positions {
    return frameOf(this.core, this.stream.header, block, time, into);
  }

  /** A block for shaders. @throws CorruptStreamError where its fields are beyond all numbers. */
  fieldsOf(block: DecodedBlock): BlockFields {
    return fieldsOf(this.core, this.stream.header.scale, block);
  }

  /** Gives its memory back, but that of blocks that are still open. */
  close(): void {
    this.decoder.close();
    this.mesh.close();
  }

  private stored(number: number): StoredBlock {
    const { places, starts } = this.stream;
    const place = places[number];
    if (!place) {
      throw new InvalidInputError(`the stream has ${places.length} blocks; got block ${number}`);
    }
    const bytes = this.bytes.subarray(place.position);
    return readBlock(bytes, place, number, starts[number]);
  }
}
