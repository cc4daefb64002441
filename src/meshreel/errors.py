"""The errors of meshreel; every one says what came, what is allowed and what to do."""


class MeshReelError(Exception):
    """Base of every error that meshreel raises on purpose."""


class InvalidInputError(MeshReelError, ValueError):
    """An argument or a mesh sequence that cannot be used as given."""


class FormatError(MeshReelError):
    """A file of another program that cannot be read or written."""


class CorruptStreamError(MeshReelError):
    """A `.reel` stream whose bytes contradict themselves or their checksums."""


class TruncatedStreamError(CorruptStreamError):
    """A `.reel` stream that ends before its end marker."""


class UnsupportedVersionError(MeshReelError):
    """A `.reel` stream that needs a newer build, or a part this build does not know."""


class SolverError(MeshReelError):
    """A reconstruction system that has no unique solution, and why."""


class WorkerDiedError(MeshReelError):
    """Work that was given up because the processes that did it died."""
