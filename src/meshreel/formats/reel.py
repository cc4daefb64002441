"""Streams of our own, read and written like any other file."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.errors import MeshReelError
from meshreel.sequence import MeshSequence


def read_reel(path: Path, *, fps: float | None = None) -> MeshSequence:
    """The sequence that a `.reel` file holds; of the file's name if the stream has none.

    Raises
    ------
    CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
        If it is not a whole stream that this build reads; they name the file.
    """
    with errors_naming(path):
        sequence = decode(path.read_bytes())
    return MeshSequence(
        sequence.vertices,
        sequence.faces,
        sequence.fps if fps is None else fps,
        sequence.name or path.stem,
    )


@contextmanager
def errors_naming(path: Path) -> Iterator[None]:
    """Within it, errors about the contents of a file begin with its path."""
    try:
        yield
    except MeshReelError as error:
        raise type(error)(f"{path}: {error}") from None


def write_reel(path: Path, sequence: MeshSequence) -> None:
    """Write the sequence as a stream, coded by default options."""
    path.write_bytes(encode(sequence))
