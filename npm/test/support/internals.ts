// Modules of the package that tests look into.

export { Core } from "../../src/core/core.js";
export { Heap } from "../../src/core/heap.js";
export { BlockDecoder } from "../../src/decode/block_decoder.js";
export { decodeConnectivity } from "../../src/decode/connectivity.js";
export { readCornerRows } from "../../src/decode/corner_rows.js";
export { readCorrections } from "../../src/decode/corrections.js";
export { decodeFields } from "../../src/decode/fields.js";
export { frameOf } from "../../src/decode/frames.js";
export { buildHierarchy } from "../../src/decode/hierarchy.js";
export { itemGraph } from "../../src/decode/item_graph.js";
export { Items } from "../../src/decode/items.js";
export { readTrack, readTrackBlock } from "../../src/decode/track.js";
export { ModesBlock } from "../../src/decode/track_block.js";
export { POSITIONS, TrackEngine } from "../../src/engine/track_engine.js";
export { MemoryReel } from "./memory_reel.js";
export * from "../../src/errors.js";
export { readBlock } from "../../src/stream/block_sections.js";
export { crc32 } from "../../src/stream/crc32.js";
export { readHeader } from "../../src/stream/header.js";
export {
  firstBlock,
  indexPayload,
  indexPosition,
  readIndex,
} from "../../src/stream/index_section.js";
export { END_SIZE_BYTES, LONGEST_HEADER, Section } from "../../src/stream/layout.js";
export { Scan } from "../../src/stream/scan.js";
export { readSection, readSections, sectionEnd } from "../../src/stream/sections.js";
export { checkedStream, nTracks, readStream } from "../../src/stream/stream.js";
export { readAttribute } from "../../src/surface/attributes.js";
export { Polygons } from "../../src/surface/polygons.js";
