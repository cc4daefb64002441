// The mesh of a stream: its triangles, and the order in which vertices and faces go out.

import type { Core } from "../core/core.js";
import type { Scope } from "../core/heap.js";
import { CorruptStreamError, MeshReelError } from "../errors.js";
import type { Header } from "../stream/header.js";
import { MOST_FACES, MOST_VERTICES, Section } from "../stream/layout.js";
import type { StoredSection } from "../stream/sections.js";
import { onlySection } from "../stream/stream.js";

const DROPPED = 2;
const VERTICES_ONLY = 1;
const VERTICES_AND_FACES = 2;

/** What values lie on: vertices, or faces or corners that are next to each other. */
export interface ItemGraph {
  readonly nVerts: number;
  readonly nFaces: number;
  /**
   * Address of the faces as they are coded, which blocks refer to; the items at the corners of each
   * are next to each other. Whoever asked for them gives them back.
   */
  readonly internalFaces: number;
  /** Internal number of each vertex that goes out. */
  readonly sequence: Int32Array;
}

/** What connectivity says. */
export interface Connectivity extends ItemGraph {
  /** Triangles as they go out. */
  readonly triangles: Uint32Array;
}

/**
 * The connectivity of a stream; its faces stay in the memory of the core.
 *
 * @throws CorruptStreamError where it is damaged.
 * @throws MeshReelError where the mesh is too large for a page.
 */
export function decodeConnectivity(
  core: Core,
  header: Header,
  leading: readonly StoredSection[],
): Connectivity {
  return core.keeping((scope, keep) => decodeWithin(core, scope, keep, header, leading));
}

function decodeWithin(
  core: Core,
  scope: Scope,
  keep: (start: number) => number,
  header: Header,
  leading: readonly StoredSection[],
): Connectivity {
  const { nVerts, nFaces } = header;
  const data = onlySection(leading, Section.CONNECTIVITY);
  if (nVerts > MOST_VERTICES || nFaces > MOST_FACES) {
    throw new MeshReelError(
      `a mesh of ${nVerts} vertices and ${nFaces} faces is too large for a page; ` +
        `${MOST_VERTICES} and ${MOST_FACES} are possible`,
    );
  }
  const internalFaces = keep(scope.take(12 * nFaces));
  core.during((inner) => {
    const counts = [BigInt(nVerts), BigInt(nFaces)] as const;
    const size = core.functions.reel_connectivity_decode_memory(...counts) >>> 0;
    const result = core.functions.reel_connectivity_decode(
      inner.take(size),
      size,
      inner.put(data),
      data.length,
      ...counts,
      internalFaces,
    );
    core.checked(result, "faces");
  });
  const isDropped = header.order === DROPPED;
  const order = isDropped ? new Uint8Array(0) : onlySection(leading, Section.ORDER);
  return {
    nVerts,
    nFaces,
    internalFaces,
    ...decodeOrder(core, order, internalFaces, nVerts, nFaces),
  };
}

function decodeOrder(
  core: Core,
  payload: Uint8Array,
  internalFaces: number,
  nVerts: number,
  nFaces: number,
): Pick<Connectivity, "sequence" | "triangles"> {
  const faces = (): Uint32Array => core.uint32s(internalFaces, 3 * nFaces);
  if (!payload.length) {
    return {
      sequence: Int32Array.from({ length: nVerts }, (_, v) => v),
      triangles: faces().slice(),
    };
  }
  const [kind] = payload;
  if (kind !== VERTICES_ONLY && kind !== VERTICES_AND_FACES) {
    throw new CorruptStreamError("the order is of an unknown kind");
  }
  if (payload.length > 1 && !payload[payload.length - 1]) {
    throw new CorruptStreamError("the order ends before its section does");
  }
  return core.during((scope) => {
    const withFaces = kind === VERTICES_AND_FACES;
    const twins = withFaces ? findTwins(core, scope, internalFaces, nFaces, nVerts) : 0;
    const corners = withFaces ? scope.take(4 * nFaces) : 0;
    const vertices = scope.take(4 * nVerts);
    const counts = [BigInt(nVerts), BigInt(nFaces)] as const;
    const size = core.functions.reel_order_memory(...counts) >>> 0;
    const result = core.functions.reel_order_decode(
      scope.take(size),
      size,
      scope.put(payload.subarray(1)),
      payload.length - 1,
      internalFaces,
      twins,
      ...counts,
      BigInt(withFaces),
      corners,
      vertices,
    );
    core.checked(result, "orders");
    const sequence = core.int32s(vertices, nVerts).slice();
    const listed = withFaces ? core.int32s(corners, nFaces) : null;
    return { sequence, triangles: listFaces(faces(), inverse(sequence), listed) };
  });
}

/** The address of the opposite side of each side, in the scope; of itself where there is none. */
export function findTwins(
  core: Core,
  scope: Scope,
  faces: number,
  nFaces: number,
  nVerts: number,
): number {
  const twins = scope.take(12 * nFaces);
  core.during((inner) => {
    const size = core.functions.reel_twins_memory(BigInt(nVerts), BigInt(nFaces)) >>> 0;
    const memory = inner.take(size);
    const counts = [BigInt(nFaces), BigInt(nVerts)] as const;
    core.checked(core.functions.reel_twins(memory, size, faces, ...counts, twins), "faces");
  });
  return twins;
}

/** The place of each of 0..n-1 in an order of them. */
export function inverse(order: Int32Array): Int32Array {
  const places = new Int32Array(order.length);
  for (let place = 0; place < order.length; place++) places[order[place]] = place;
  return places;
}

/** Faces with their vertices renamed, listed by their first corners, or in their order. */
function listFaces(faces: Uint32Array, names: Int32Array, corners: Int32Array | null): Uint32Array {
  const found = new Uint32Array(faces.length);
  for (let i = 0; i < faces.length; i += 3) {
    let corner = corners ? corners[i / 3] : i;
    const last = corner - (corner % 3) + 2;
    for (let k = i; k < i + 3; k++) {
      found[k] = names[faces[corner]];
      corner = corner === last ? last - 2 : corner + 1;
    }
  }
  return found;
}
