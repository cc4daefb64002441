// Groups of faces, such as those of a material.

import type { Core } from "../core/core.js";
import { decodeIntegers } from "../decode/integers.js";
import { CorruptStreamError } from "../errors.js";
import { ByteReader } from "../stream/byte_reader.js";
import type { Surface } from "../types.js";

/**
 * Groups from the payload of their section.
 *
 * @throws CorruptStreamError where a face is in a group that does not exist.
 */
export function readGroups(
  core: Core,
  payload: Uint8Array,
  nFaces: number,
): Surface["groups"][number] {
  const reader = new ByteReader(payload);
  const name = reader.text();
  const nLabels = reader.varint();
  if (nLabels > payload.length) {
    throw new CorruptStreamError(`${nLabels} labels are announced in ${payload.length} bytes`);
  }
  const labels = Array.from({ length: nLabels }, () => reader.text());
  const [ofFace] = decodeIntegers(core, reader.rest(), [nFaces]);
  let group = 0;
  for (let i = 0; i < nFaces; i++) {
    group += ofFace[i];
    if (!(group >= -1 && group < nLabels)) {
      throw new CorruptStreamError(`groups '${name}' refer to a group that does not exist`);
    }
    ofFace[i] = group;
  }
  return { name, labels, ofFace };
}
