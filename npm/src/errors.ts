// What goes wrong, by type; messages are those of the Python package.

/** Base class of all errors that meshreel throws, but for aborted work (`AbortError`). */
export class MeshReelError extends Error {
  override name = "MeshReelError";
}

/** An argument that cannot be used as given. */
export class InvalidInputError extends MeshReelError {
  override name = "InvalidInputError";
}

/** A stream whose bytes are inconsistent or do not match their checksums. */
export class CorruptStreamError extends MeshReelError {
  override name = "CorruptStreamError";
}

/** A stream that ends before its end marker. */
export class TruncatedStreamError extends CorruptStreamError {
  override name = "TruncatedStreamError";
}

/** A stream that needs a newer version of meshreel, or a method that pages do not decode. */
export class UnsupportedVersionError extends MeshReelError {
  override name = "UnsupportedVersionError";
}

/** A stream whose decoding would take more memory than the reader may. */
export class MemoryLimitError extends MeshReelError {
  override name = "MemoryLimitError";
}

/** Bytes that a server or a file did not give, or that are of another file than before. */
export class SourceError extends MeshReelError {
  override name = "SourceError";
}
