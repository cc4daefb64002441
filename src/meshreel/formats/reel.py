"""Streams of our own, read and written like any other file."""

import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import MeshReelError
from meshreel.formats.frame_stream import FrameStream
from meshreel.sequence import MeshSequence


def open(path: str | os.PathLike[str], *, n_modes: int | None = None) -> ReelFile:
    """A `.reel` file to take frames from: its index is read, and nothing decoded yet.

    Parameters
    ----------
    path : str or path
    n_modes : int, optional
        Stop after so many modes of each block: a coarser animation, sooner. Streams of `reel`
        only; corrections are left out then.

    Raises
    ------
    InvalidInputError
        If `n_modes` is below 1 or not for this stream.
    CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
        If it is not a stream that this build reads, or not even its first block is whole.
    OSError
        If the file cannot be read.

    Examples
    --------
    >>> with meshreel.open("walk.reel") as reel:
    ...     frame, part = reel[1234], reel[100:200]
    ...     for frame in reel:
    ...         show(frame)
    """
    with ExitStack() as on_error:
        file = on_error.enter_context(Path(path).open("rb"))
        with errors_naming(Path(path)):
            reel = ReelFile(file, n_modes)
        on_error.pop_all()
    return reel


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


def write_reel(path: Path, stream: FrameStream) -> None:
    """Write the frames as a `.reel` file, coded by default options; all are gathered for it."""
    path.write_bytes(encode(stream.gather()))
