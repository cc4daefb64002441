// Decodes the positions of a stream whose bytes come when they are asked for.

import type { Core } from "../core/core.js";
import { BlockDecoder, POSITION_COLUMNS } from "../decode/block_decoder.js";
import { fieldsOf } from "../decode/block_fields.js";
import { type Connectivity, decodeConnectivity } from "../decode/connectivity.js";
import type { DecodedBlock } from "../decode/decoded_block.js";
import { frameOf, type Positions } from "../decode/frames.js";
import { readInfo } from "../decode/info.js";
import { Items } from "../decode/items.js";
import { REEL } from "../decode/methods.js";
import { readTracks } from "../decode/track_infos.js";
import { type StoredBlock, readBlock } from "../stream/block_sections.js";
import { Section } from "../stream/layout.js";
import type { Stream } from "../stream/stream.js";
import { readSurface } from "../surface/surface.js";
import type { BlockFields, ReelInfo, Surface } from "../types.js";
import { KeptBlocks } from "./kept_blocks.js";
import { type Beginning, type Read, openStream } from "./opening.js";

/** Sections before the first block that further tracks need. */
const OF_TRACKS: readonly number[] = [
  Section.CONNECTIVITY,
  Section.ORDER,
  Section.POLYGONS,
  Section.TRACK,
];

export class Engine {
  readonly info: ReelInfo;
  readonly surface: Surface;
  private readonly blocks: KeptBlocks<DecodedBlock>;

  private constructor(
    private readonly core: Core,
    private readonly read: Read,
    private readonly stream: Stream,
    early: EarlyMesh | null,
  ) {
    const { header, leading, places, starts } = stream;
    const info = readInfo(stream);
    const isEarly = early?.end === places[0].position;
    if (!isEarly) early?.mesh.close();
    const mesh = isEarly ? early.mesh : new Items(core, decodeConnectivity(core, header, leading));
    this.surface = readSurface(core, leading, mesh.graph.triangles, header.nVerts, stream.memory);
    this.info = { ...info, tracks: readTracks(stream, this.surface.faceSizes) };
    const decoder = new BlockDecoder(mesh, POSITION_COLUMNS, stream.memory);
    this.blocks = new KeptBlocks(starts, async (number, signal) =>
      decoder.prepare(await this.stored(number, signal), (key) => this.stored(key, signal)),
    );
  }

  /**
   * Reads what comes before the first block, and the index.
   *
   * @throws MeshReelError as `openStream` and the decoders.
   */
  static async open(
    core: Promise<Core>,
    read: Read,
    size: number | null,
    hasRanges: boolean,
    signal: AbortSignal,
    memory: number,
  ): Promise<Engine> {
    let early: EarlyMesh | null = null;
    const begin = async (beginning: Beginning): Promise<void> => {
      early = earlyMesh(await core, beginning);
    };
    const stream = await openStream(read, size, hasRanges, signal, memory, begin);
    return new Engine(await core, read, stream, early);
  }

  /** Positions of a frame, which has to be there. */
  async frame(number: number, signal: AbortSignal): Promise<Positions> {
    return frameOf(this.core, this.stream.header, ...(await this.blocks.ofFrame(number, signal)));
  }

  /** A block, which has to be there, for shaders. */
  async fields(block: number, signal: AbortSignal): Promise<BlockFields> {
    return fieldsOf(this.core, this.stream.header.scale, await this.blocks.block(block, signal));
  }

  /** What further tracks are decoded with, as a copy. */
  ofTracks(): Stream {
    const leading = this.stream.leading
      .filter(({ id }) => OF_TRACKS.includes(id))
      .map((section) => ({ ...section, payload: section.payload.slice() }));
    return { ...this.stream, leading };
  }

  /** Decodes what is likely to be asked for next. */
  async goAhead(): Promise<void> {
    await this.blocks.goAhead();
  }

  private async stored(number: number, signal: AbortSignal): Promise<StoredBlock> {
    const { places, starts } = this.stream;
    const place = places[number];
    const end = place.position + place.sizes[0];
    const bytes = await this.read(place.position, end, signal);
    return readBlock(bytes, place, number, starts[number]);
  }
}

/** A mesh that was made ready while the end of its stream was on its way. */
interface EarlyMesh {
  readonly mesh: Items<Connectivity>;
  /** Byte of the stream at which the first block begins. */
  readonly end: number;
}

/** Decodes what leads to the blocks; null where that fails, which is told once all is here. */
function earlyMesh(core: Core, { header, leading, end, layout }: Beginning): EarlyMesh | null {
  if (header.method !== REEL) return null;
  let mesh: Items<Connectivity> | null = null;
  try {
    mesh = new Items(core, decodeConnectivity(core, header, leading));
    mesh.hierarchyOf(layout.stencilSize);
    return { mesh, end };
  } catch {
    mesh?.close();
    return null;
  }
}
