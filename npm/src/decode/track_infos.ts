// The tracks of a stream, as far as this build understands them: they are decoded elsewhere.

import { CorruptStreamError } from "../errors.js";
import { ByteReader } from "../stream/byte_reader.js";
import { Section } from "../stream/layout.js";
import type { Stream } from "../stream/stream.js";
import type { TrackInfo } from "../types.js";

export const KINDS = [
  "other",
  "vector",
  "velocity",
  "normal",
  "color",
  "uv",
  "scalar",
] as const;
/** Where values are, by their codes; corners may share those of their vertices, or of rows. */
export const DOMAINS = ["vertex", "face", "corner", "corner", "corner"] as const;
export const OF_VERTICES = 3;
export const IN_ROWS = 4;

/** Kinds of numbers, by the high bits of the code of a number type; the low ones are its bytes. */
const NUMBERS = ["float", "uint", "int"];

/** Codings of values that are those of the original; all others have bounds. */
export const EXACT = 1;
export const EXACT_BACKWARD = 6;
export const EXACT_FORWARD = 8;

/** Whether values of a coding, which may be unknown, come back bit for bit. */
export function isExactCoding(coding: number): boolean {
  return coding === EXACT || (coding >= EXACT_BACKWARD && coding <= EXACT_FORWARD);
}

const UNKNOWN = "unknown";

/** Facts of all tracks; what is damaged or of a newer build is unknown. */
export function readTracks(stream: Stream, faceSizes: Uint32Array | null): TrackInfo[] {
  const { header, leading, places } = stream;
  const nPolygons = faceSizes?.length ?? header.nFaces;
  const counts = { vertex: header.nVerts, face: nPolygons, corner: header.nFaces + 2 * nPolygons };
  return leading
    .filter(({ id }) => id === Section.TRACK)
    .map(({ payload }, i) => {
      const [kind, domain, numberType, coding] = payload;
      const isOf = DOMAINS[domain];
      const isExact = isExactCoding(coding);
      const { bound, ...named } = readName(payload, coding);
      return {
        ...named,
        isExact,
        promisedError: isExact ? 0 : bound || null,
        kind: KINDS[kind] ?? UNKNOWN,
        domain: isOf ?? UNKNOWN,
        nItems: counts[isOf] ?? 0,
        numberType: numberTypeOf(numberType),
        sizeBytes: places.reduce((sum, { sizes }) => sum + sizes[i + 1], named.sizeBytes),
      };
    });
}

function numberTypeOf(code: number): TrackInfo["numberType"] {
  const nBytes = code & 15;
  const isKnown = code < 16 ? nBytes === 4 || nBytes === 8 : [1, 2, 4, 8].includes(nBytes);
  const kind = NUMBERS[code >> 4];
  return kind && isKnown ? (`${kind}${8 * nBytes}` as TrackInfo["numberType"]) : UNKNOWN;
}

/** Name, unit, columns and bound, and the size of rows; less of a section that ends before. */
function readName(payload: Uint8Array, coding: number) {
  const found = { name: "", unit: "", nColumns: 0, bound: 0, sizeBytes: 0 };
  try {
    const reader = new ByteReader(payload, 4);
    found.name = reader.text();
    found.unit = reader.text();
    found.nColumns = reader.varint();
    if (payload[1] === IN_ROWS) {
      const nNumbers = [2 + found.nColumns, 0][coding] ?? 2;
      found.sizeBytes = Math.max(0, reader.left - 8 * nNumbers);
    }
    if (!isExactCoding(coding)) found.bound = reader.float64("");
  } catch (error) {
    if (!(error instanceof CorruptStreamError)) throw error;
  }
  return found;
}
