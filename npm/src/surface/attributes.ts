// Attributes of a mesh: texture coordinates, colours and other quantities.

import type { Core } from "../core/core.js";
import { DEFAULT_MEMORY, requireMemory } from "../decode/memory.js";
import { CorruptStreamError } from "../errors.js";
import { ByteReader } from "../stream/byte_reader.js";
import type { Attribute } from "../types.js";
import type { Domain, Polygons } from "./polygons.js";
import { decodeReferences } from "./references.js";
import { NUMBER_TYPES, type NumberType, type Numbers, decodeTable } from "./tables.js";

const KINDS = ["texcoord", "color", "other"] as const;
const DOMAINS = ["vertex", "face", "corner"] as const;
const MAX_WIDTH = 16;

/** Of a row of a table while it is decoded: what it is expected from, beside its numbers. */
const BYTES_OF_ROW = 32;

const EACH = 0;
const SHARED = 2;

/** An attribute as it is stored: a table, and the row of each item (null: its own). */
export interface StoredAttribute extends Omit<Attribute, "values"> {
  readonly table: Numbers;
  readonly rows: Int32Array | null;
}

/**
 * An attribute from the payload of its section.
 *
 * @param memory - Bytes that decoding may take at once.
 * @throws MemoryLimitError where its table is larger than allowed.
 * @throws CorruptStreamError where it is damaged, or does not fit the mesh.
 */
export function readAttribute(
  core: Core,
  payload: Uint8Array,
  polygons: Polygons,
  memory = DEFAULT_MEMORY,
): StoredAttribute {
  const reader = new ByteReader(payload);
  const head = reader.take(4, "an attribute ends inside its first four bytes");
  const [kind, domain, numberType, width] = head;
  if (!(width >= 1 && width <= MAX_WIDTH)) {
    throw new CorruptStreamError(`values of ${width} numbers; 1..${MAX_WIDTH} are allowed`);
  }
  if (kind >= KINDS.length || domain >= DOMAINS.length || numberType >= NUMBER_TYPES.length) {
    throw new CorruptStreamError(
      `an attribute is of kind ${kind}, domain ${domain} and number type ${numberType}, one of ` +
        "which is unknown",
    );
  }
  const said = { name: reader.text(), kind: KINDS[kind], domain: DOMAINS[domain], width };
  const { rows, nRows } = readRows(core, reader, said.domain, polygons);
  const isOfFaces = said.domain === "face"; // which are not near each other in triangles
  const along = isOfFaces ? null : () => rowsOfTriangles(said.domain, rows, polygons);
  const type = NUMBER_TYPES[numberType];
  const rowBytes = BYTES_OF_ROW + width * type.BYTES_PER_ELEMENT;
  requireMemory(memory, nRows * rowBytes, `a table of ${nRows} values`);
  const table = decodeTable(core, reader.rest(), nRows, width, type, along);
  return { ...said, table, rows };
}

/** An attribute with a row of its own for each vertex, face or corner. */
export function withOwnRows({ table, rows, ...said }: StoredAttribute): Attribute {
  if (!rows) return { ...said, values: table };
  const { width } = said;
  const values = new (table.constructor as NumberType)(rows.length * width);
  rows.forEach((row, i) => {
    for (let k = 0; k < width; k++) values[i * width + k] = table[row * width + k];
  });
  return { ...said, values };
}

function readRows(
  core: Core,
  reader: ByteReader,
  domain: Domain,
  polygons: Polygons,
): { rows: Int32Array | null; nRows: number } {
  const unknown = "it is not known how the values of an attribute are laid out";
  const layout = reader.byte(unknown);
  if (layout > SHARED) throw new CorruptStreamError(unknown);
  const nRows = reader.varint();
  const sizeBytes = Math.min(reader.varint(), reader.left);
  const coded = reader.take(sizeBytes, unknown);
  const nItems = polygons.count(domain);
  if (layout === EACH) {
    if (nRows !== nItems || coded.length) {
      throw new CorruptStreamError(`an attribute has ${nRows} values for ${nItems} places`);
    }
    return { rows: null, nRows };
  }
  const isOfCorners = domain === "corner";
  const places = isOfCorners ? polygons.verticesOfCorners() : new Uint8Array(nItems);
  const rows = decodeReferences(core, coded, places, isOfCorners ? polygons.nVerts : 1);
  if (rows.some((row) => row < 0 || row >= nRows)) {
    throw new CorruptStreamError("an attribute refers to a value that does not exist");
  }
  return { rows, nRows };
}

/** The row at each corner of a triangle. */
function rowsOfTriangles(domain: Domain, rows: Int32Array | null, polygons: Polygons): Int32Array {
  const items =
    domain === "vertex" ? Int32Array.from(polygons.triangles) : polygons.cornersOfTriangles();
  return rows ? items.map((item) => rows[item]) : items;
}
