"""Streams of our own, read and written like any other file."""

from pathlib import Path

from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.sequence import MeshSequence


def read_reel(path: Path, *, fps: float | None = None) -> MeshSequence:
    """The sequence that a `.reel` file holds; of the file's name if the stream has none.

    Raises
    ------
    CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
        If it is not a whole stream that this build reads.
    """
    sequence = decode(path.read_bytes())
    return MeshSequence(
        sequence.vertices,
        sequence.faces,
        sequence.fps if fps is None else fps,
        sequence.name or path.stem,
    )


def write_reel(path: Path, sequence: MeshSequence) -> None:
    """Write the sequence as a stream, coded by default options."""
    path.write_bytes(encode(sequence))
