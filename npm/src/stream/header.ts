// The header of a stream: its sizes, method and number types.

import { CorruptStreamError, TruncatedStreamError, UnsupportedVersionError } from "../errors.js";
import { decodedText } from "./byte_reader.js";
import { counted } from "./counting.js";
import { crc32 } from "./crc32.js";
import { foreignKind } from "./foreign.js";
import { FORMAT_VERSION, MAGIC, MAX_NAME_BYTES } from "./layout.js";

const FIXED_BYTES = 68;

/** What the header of a stream says. */
export interface Header {
  /** 0 where it was not known when the header was written. */
  readonly nFrames: number;
  readonly nVerts: number;
  readonly nFaces: number;
  /** Frames per second; 0 where it is not known. */
  readonly fps: number;
  /** Bytes of a coordinate as it goes out. */
  readonly vertexType: 4 | 8;
  readonly method: number;
  readonly laplacian: number;
  /** What is kept: 0 the order of vertices and faces, 1 that of vertices, 2 neither. */
  readonly order: number;
  readonly origin: readonly [number, number, number];
  /** Diagonal of the bounding box of all frames, in model units. */
  readonly scale: number;
  readonly name: string;
  /** Bytes of the header itself. */
  readonly sizeBytes: number;
}

/**
 * The header at the start of a stream.
 *
 * @param data - At least its first `LONGEST_HEADER` bytes, or all that there are.
 * @throws CorruptStreamError where the data are not a `.reel` stream, or the header is damaged.
 * @throws TruncatedStreamError where the data end inside the header.
 * @throws UnsupportedVersionError where the stream is of another version than this build reads.
 */
export function readHeader(data: Uint8Array): Header {
  const view = new DataView(data.buffer, data.byteOffset, data.byteLength);
  checkMagicAndVersion(data, view);
  if (data.length < FIXED_BYTES) throw cutOff(data, FIXED_BYTES);
  const nameBytes = view.getUint16(66, true);
  if (nameBytes > MAX_NAME_BYTES) {
    throw new CorruptStreamError(
      `the header announces a name of ${nameBytes} bytes; at most ${MAX_NAME_BYTES} are allowed`,
    );
  }
  const end = FIXED_BYTES + nameBytes;
  if (data.length < end + 4) throw cutOff(data, end + 4);
  if (crc32(data.subarray(0, end)) !== view.getUint32(end, true)) {
    throw new CorruptStreamError("the header's checksum does not match; the file is damaged");
  }
  const name = decodedText(data.subarray(FIXED_BYTES, end), "the name is not UTF-8");
  return checkedHeader(view, name, end + 4);
}

function checkMagicAndVersion(data: Uint8Array, view: DataView): void {
  if (!data.length) throw new TruncatedStreamError("the stream is empty (0 bytes)");
  const begin = [...data.subarray(0, MAGIC.length)];
  if (begin.some((byte, i) => byte !== MAGIC[i])) {
    const how = `it starts with ${hexadecimal(begin)}, not ${hexadecimal(MAGIC)}`;
    throw new CorruptStreamError(`not a .reel stream: ${foreignKind(data) ?? how}`);
  }
  if (data.length < MAGIC.length + 2) throw cutOff(data, FIXED_BYTES);
  const version = view.getUint16(MAGIC.length, true);
  if (version >= 1 && version < FORMAT_VERSION) {
    throw new UnsupportedVersionError(
      `the stream is format ${version}, which meshreel wrote before its first release; this ` +
        `build reads format ${FORMAT_VERSION}; encode the original again`,
    );
  }
  if (version !== FORMAT_VERSION) {
    throw new UnsupportedVersionError(
      `the stream is format ${version}; this build reads format ${FORMAT_VERSION}; upgrade ` +
        "meshreel (or the file is damaged)",
    );
  }
}

function checkedHeader(view: DataView, name: string, sizeBytes: number): Header {
  const vertexType = view.getUint8(30);
  const fps = view.getFloat64(22, true);
  const origin = [34, 42, 50].map((place) => view.getFloat64(place, true));
  const scale = view.getFloat64(58, true);
  const [nFrames, nVerts, nFaces] = [10, 14, 18].map((place) => view.getUint32(place, true));
  if (Math.min(nVerts, nFaces) < 1) {
    throw new CorruptStreamError(
      `the header announces ${counted(nVerts, "vertex", "vertices")} and ` +
        `${counted(nFaces, "face")}; each must be at least 1`,
    );
  }
  if (vertexType !== 4 && vertexType !== 8) {
    throw new CorruptStreamError(`vertex type ${vertexType} is unknown; 4 and 8 are allowed`);
  }
  if (![...origin, scale, fps].every(Number.isFinite)) {
    throw new CorruptStreamError("the header holds a number that is not finite");
  }
  if (!(scale > 0 && fps >= 0)) {
    throw new CorruptStreamError(`scale ${scale} must be positive and fps ${fps} not negative`);
  }
  const [method, laplacian, order] = [31, 32, 33].map((place) => view.getUint8(place));
  return {
    ...{ nFrames, nVerts, nFaces, fps, vertexType, method, laplacian, order },
    ...{ origin: origin as [number, number, number], scale, name, sizeBytes },
  };
}

function cutOff(data: Uint8Array, needed: number): TruncatedStreamError {
  return new TruncatedStreamError(
    `the stream ends at byte ${data.length}, inside the header of at least ${needed} bytes`,
  );
}

function hexadecimal(bytes: readonly number[]): string {
  return bytes.map((byte) => byte.toString(16).padStart(2, "0")).join(" ");
}
