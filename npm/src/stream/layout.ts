// The constants of the container, which docs/format.md explains.

/** Begins every stream. */
export const MAGIC = [0x89, 0x52, 0x45, 0x45, 0x4c, 0x0d, 0x0a, 0x1a];

/** The version that this build reads. */
export const FORMAT_VERSION = 3;

/** Bit of a section id: readers that do not know the section skip it. */
export const OPTIONAL = 0x80;

/** Ids of the sections. */
export const Section = {
  END: 0,
  CONNECTIVITY: 1,
  ORDER: 2,
  ANCHOR_VERTICES: 3,
  SHAPE: 4,
  BLOCK: 16,
  BASIS: 17,
  ANCHORS: 18,
  COEFFICIENTS: 19,
  EXACT: 20,
  FIELDS: 21,
  CORRECTIONS: 22,
  TRACK_BLOCK: 23,
  VALUES: 24,
  MISSING: 25,
  ANCHOR_RESIDUALS: 26,
  PROMISE: 129,
  INDEX: 130,
  POLYGONS: 131,
  ATTRIBUTE: 132,
  GROUPS: 133,
  PARTS: 134,
  START: 135,
  MATERIAL: 136,
  IMAGE: 137,
  TRACK: 138,
  HARD_EDGES: 139,
} as const;

const NAMES = new Map<number, string>(Object.entries(Section).map(([name, id]) => [id, name]));

/** Whether this build knows a section. */
export function isKnown(id: number): boolean {
  return NAMES.has(id);
}

/** The name of a section, or its number where it has none. */
export function sectionName(id: number): string {
  return NAMES.get(id) ?? `${id}`;
}

/** Whether sections of this id belong to a block. */
export function isOfBlock(id: number): boolean {
  return id >= Section.BLOCK && id < OPTIONAL;
}

/** Most vertices and faces of a mesh whose hierarchy fits into the memory of a page. */
export const MOST_VERTICES = 1 << 22;
export const MOST_FACES = 1 << 23;

/** The section END of a stream with an index: id, length, position, checksum. */
export const END_SIZE_BYTES = 14;

/** Longest name of a sequence, in UTF-8. */
export const MAX_NAME_BYTES = 4096;

/** Fixed part, longest name and checksum. */
export const LONGEST_HEADER = 68 + MAX_NAME_BYTES + 4;
