// What the stored values of tracks lie on, found once for all tracks that lie on the same.

import { readCornerRows, rowGraph } from "../decode/corner_rows.js";
import type { Connectivity } from "../decode/connectivity.js";
import { itemGraph } from "../decode/item_graph.js";
import { Items } from "../decode/items.js";
import type { Track } from "../decode/track.js";
import type { Polygons } from "../surface/polygons.js";

/** What the stored values of a track lie on. */
export interface StoredItems {
  readonly items: Items;
  /** Items that values are decoded for: those stored, or the corners, if these are more. */
  readonly mostItems: number;
  /** The value that each corner has, where corners share them. */
  readonly spread: Int32Array | null;
  /** As it goes out, where values are of rows. */
  readonly vertexOfRow: Int32Array | null;
}

export class TrackItems {
  private readonly found = new Map<string, StoredItems>();

  /**
   * @param mesh - The vertices.
   * @param polygons - Of the mesh as it goes out.
   */
  constructor(
    private readonly mesh: Items<Connectivity>,
    private readonly polygons: () => Polygons,
  ) {}

  /**
   * What a track lies on.
   *
   * @throws MeshReelError as `itemGraph`, `readCornerRows` and `rowGraph`.
   */
  of(track: Track): StoredItems {
    const key = `${track.shared ?? track.domain}${track.rows.join()}`;
    const found = this.found.get(key) ?? this.find(track);
    this.found.set(key, found);
    return found;
  }

  private find({ domain, shared, rows }: Track): StoredItems {
    const { core, graph } = this.mesh;
    if (shared === "rows") {
      const found = readCornerRows(core, rows, this.polygons(), graph.sequence);
      const items = new Items(core, rowGraph(core, found, this.polygons()));
      return spreadOut(items, found.ofCorners, found.vertices);
    }
    if (shared === "vertices") {
      return spreadOut(this.mesh, Int32Array.from(this.polygons().verticesOfCorners()), null);
    }
    const items =
      domain === "vertex" ? this.mesh : new Items(core, itemGraph(core, domain, this.polygons()));
    return { items, mostItems: items.graph.nVerts, spread: null, vertexOfRow: null };
  }
}

function spreadOut(
  items: Items,
  spread: Int32Array,
  vertexOfRow: Int32Array | null,
): StoredItems {
  const mostItems = Math.max(items.graph.nVerts, spread.length);
  return { items, mostItems, spread, vertexOfRow };
}
