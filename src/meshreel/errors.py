"""Exceptions of meshreel; a message names the value, what is allowed and what to do."""


class MeshReelError(Exception):
    """Base class of all errors that meshreel raises."""


class InvalidInputError(MeshReelError, ValueError):
    """An argument or a mesh sequence that cannot be used as given."""


class ConnectivityChangeError(InvalidInputError):
    """A sequence whose faces change where constant connectivity is needed."""


class FormatError(MeshReelError):
    """A file of another program that cannot be read or written."""


class CorruptStreamError(MeshReelError):
    """A `.reel` stream whose bytes are inconsistent or do not match their checksums."""


class TruncatedStreamError(CorruptStreamError):
    """A `.reel` stream that ends before its end marker."""


class UnsupportedVersionError(MeshReelError):
    """A `.reel` stream that needs a newer version of meshreel."""


class MemoryLimitError(MeshReelError):
    """A `.reel` stream whose decoding would exceed the memory limit."""


class SolverError(MeshReelError):
    """A reconstruction system that has no unique solution."""


class WorkerDiedError(MeshReelError):
    """Work that was abandoned because its worker processes died."""


class StoreError(MeshReelError):
    """A remote file that does not exist, or cannot be read or written."""
