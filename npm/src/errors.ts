// Error classes, with the names of the Python package.

/** Base class of all errors that meshreel throws, except `AbortError` of canceled calls. */
export class MeshReelError extends Error {
  override name = "MeshReelError";
}

/** An invalid argument. */
export class InvalidInputError extends MeshReelError {
  override name = "InvalidInputError";
}

/** A file whose bytes are inconsistent or do not match their checksums. */
export class CorruptStreamError extends MeshReelError {
  override name = "CorruptStreamError";
}

/** A file that ends before its end marker. */
export class TruncatedStreamError extends CorruptStreamError {
  override name = "TruncatedStreamError";
}

/** A file that needs a newer version of meshreel, or a method that this package cannot decode. */
export class UnsupportedVersionError extends MeshReelError {
  override name = "UnsupportedVersionError";
}

/** A file whose decoding needs more memory than the limit. */
export class MemoryLimitError extends MeshReelError {
  override name = "MemoryLimitError";
}

/** Bytes that cannot be read, or a file that has changed since it was opened. */
export class SourceError extends MeshReelError {
  override name = "SourceError";
}
