"""Streams of our own, read and written like any other file."""

import math
import os
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from meshreel.codec.achieved import measure_stream
from meshreel.codec.config import DEFAULT_ORDER
from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.reel_file import ReelFile
from meshreel.formats.file_errors import errors_naming
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.options import Origin, ReadOptions, WriteOptions
from meshreel.sequence import MeshSequence


def open(path: str | os.PathLike[str], *, n_modes: int | None = None) -> ReelFile:
    """A `.reel` file to take frames from: its index is read, and nothing decoded yet.

    Parameters
    ----------
    path : str or path
    n_modes : int, optional
        Only the first so many modes of each block move, and the others rest at their mean over
        the block: a coarser animation. Streams of `reel` only; corrections are left out then.

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


def origin_of(reel: ReelFile) -> Origin:
    """What a stream says of the animation that its frames are decoded from."""
    error = math.inf if reel.promised_error is None else reel.promised_error
    return Origin(error, reel.frame.scale)


def origin_of_file(path: str | os.PathLike[str]) -> Origin | None:
    """What a `.reel` file says of the animation that it was made of; None for any other file."""
    if Path(path).suffix.lower() != ".reel":
        return None
    with open(path) as reel:
        return origin_of(reel)


def open_reel(path: Path, options: ReadOptions) -> MeshSequence:
    """The sequence that a `.reel` file holds; of the file's name if the stream has none.

    Raises
    ------
    CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
        If it is not a whole stream that this build reads; they name the file.
    """
    with errors_naming(path):
        sequence = decode(path.read_bytes(), progress=options.progress)
    options.progress("reading", 1.0)
    fps = sequence.fps if options.fps is None else options.fps
    if sequence.name and fps == sequence.fps:  # all positions would be checked again
        return sequence
    return replace(sequence, fps=fps, name=sequence.name or path.stem)


def write_reel(path: Path, stream: FrameStream, options: WriteOptions) -> None:
    """Write the frames as a `.reel` file; all are gathered for it, and the error is noted.

    What the options leave open is as `encode` does it by default.
    """
    sequence = stream.gather()
    data = encode(sequence, max_error=options.max_error)
    path.write_bytes(data)
    if stream.is_told:
        achieved = measure_stream(sequence, data, order=DEFAULT_ORDER)
        stream.notes.append(
            f"coded with a largest error of {achieved.max_error_percent:.4f} % of the diagonal "
            f"and a KG error of {achieved.kg_error_percent:.4f} %"
        )
