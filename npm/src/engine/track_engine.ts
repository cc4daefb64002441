// Decodes further tracks of a stream, whose bytes come when they are asked for: beside the engine of
// the positions, which never waits for them.

import type { Core } from "../core/core.js";
import { BlockDecoder } from "../decode/block_decoder.js";
import { fieldsOf } from "../decode/block_fields.js";
import { type Connectivity, decodeConnectivity } from "../decode/connectivity.js";
import { type Positions, ofUnitLength, valuesOf } from "../decode/frames.js";
import { itemGraph } from "../decode/item_graph.js";
import { Items } from "../decode/items.js";
import { type Track, readTrack, readTrackBlock } from "../decode/track.js";
import { Section } from "../stream/layout.js";
import type { Stream } from "../stream/stream.js";
import { Polygons, readSizes } from "../surface/polygons.js";
import type { TrackFields } from "../types.js";
import { KeptBlocks } from "./kept_blocks.js";
import type { Read } from "./opening.js";

/** A track that was asked for. */
interface OpenTrack {
  readonly track: Track;
  readonly blocks: KeptBlocks;
}

export class TrackEngine {
  private readonly mesh: Items<Connectivity>;
  private readonly items = new Map<Track["domain"], Items>();
  private readonly tracks = new Map<number, OpenTrack>();
  private last: OpenTrack | null = null;

  /**
   * @param stream - As the engine of the positions gives it.
   * @throws CorruptStreamError where connectivity or order are damaged.
   */
  constructor(
    private readonly core: Core,
    private readonly read: Read,
    private readonly stream: Stream,
  ) {
    this.mesh = new Items(core, decodeConnectivity(core, stream.header, stream.leading));
    this.items.set("vertex", this.mesh);
  }

  /**
   * Values of a frame of a track; frame and track have to be there.
   *
   * @param track - From 0 on.
   * @throws MeshReelError as `readTrack`, `itemGraph` and `readTrackBlock`.
   */
  async values(track: number, number: number, signal: AbortSignal): Promise<Positions> {
    const found = this.open(track);
    this.last = found;
    const [block, time] = await found.blocks.ofFrame(number, signal);
    const values = valuesOf(this.core, found.track, block, time);
    return found.track.kind === "normal" ? ofUnitLength(values) : values;
  }

  /** A block of a track for shaders; as `values`. */
  async fields(track: number, block: number, signal: AbortSignal): Promise<TrackFields> {
    const { blocks, track: { scale, origin } } = this.open(track);
    const fields = fieldsOf(this.core, scale, await blocks.block(block, signal));
    return { ...fields, nColumns: origin.length, origin };
  }

  /** Decodes what is likely to be asked for next. */
  async goAhead(): Promise<void> {
    await this.last?.blocks.goAhead();
  }

  private open(number: number): OpenTrack {
    const before = this.tracks.get(number);
    if (before) return before;
    const { leading, places, starts } = this.stream;
    const track = readTrack(leading.filter(({ id }) => id === Section.TRACK)[number].payload);
    const items = this.itemsOf(track.domain);
    const shape: [number, number] = [items.graph.nVerts, track.origin.length];
    const blocks = new KeptBlocks(
      new BlockDecoder(items, track.origin.length),
      starts,
      async (block, signal) => {
        const place = places[block];
        const group = number + 1; // that of the positions is the first
        const sizes = place.sizes.slice(0, group);
        const position = sizes.reduce((sum, size) => sum + size, place.position);
        const bytes = await this.read(position, position + place.sizes[group], signal);
        return readTrackBlock(bytes, place, position, group, [block, starts[block]], shape);
      },
    );
    const found = { track, blocks };
    this.tracks.set(number, found);
    return found;
  }

  private itemsOf(domain: Track["domain"]): Items {
    const before = this.items.get(domain);
    if (before || domain === "vertex") return before!;
    const { core, mesh, stream } = this;
    const { triangles, nVerts } = mesh.graph;
    const stored = stream.leading.find(({ id }) => id === Section.POLYGONS);
    const sizes = stored ? readSizes(core, stored.payload, triangles.length / 3) : null;
    const graph = itemGraph(core, domain, new Polygons(triangles, nVerts, sizes));
    const found = new Items(core, graph);
    this.items.set(domain, found);
    return found;
  }
}
