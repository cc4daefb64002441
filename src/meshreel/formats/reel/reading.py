"""A `.reel` file as a sequence, or as frames that are decoded when they are asked for."""

import os
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

from meshreel.codec.decoder import decode
from meshreel.codec.inspect import StreamInfo, file_info
from meshreel.codec.memory import memory_limit
from meshreel.codec.reel_file import ReelFile
from meshreel.formats.file_errors import errors_naming, refuse_pipe
from meshreel.formats.options import Origin, ReadOptions, origin_of
from meshreel.kernel.files import OpenFile
from meshreel.model.sequence import MeshSequence
from meshreel.runtime.stores.address import is_remote, plain
from meshreel.runtime.stores.ranged_file import open_ranged


def open(
    path: str | os.PathLike[str],
    *,
    n_modes: int | None = None,
    segment: int | None = None,
    memory: float | str | None = None,
) -> ReelFile:
    """A `.reel` file to take frames from: its index is read, and nothing decoded yet.

    Parameters
    ----------
    path : str or path
        Of a file, or an address such as ``s3://bucket/walk.reel`` (extra ``[remote]``): then only
        what is asked for is fetched, each block with one request.
    n_modes : int, optional
        Only the first so many modes of each block move; further ones, up to the 16th at least,
        rest at their mean over the block: a coarser animation. Streams of `reel` only; corrections
        are left out then.
    segment : int, optional
        Number of a segment, from 0, as `meshreel.info` lists them: frames begin at 0 in it. Needed
        if the file has several segments, whose meshes differ.
    memory : float or str, optional
        The most that the mesh, a block, or the frames or values that a call returns may take while
        they are decoded, as in "2GiB", or bytes. Frames of a longer file than this are read a few
        at a time. Default: 8 GiB.

    Raises
    ------
    InvalidInputError
        If `n_modes` is below 1 or not for this stream, there is no such segment, or there are
        several and none is chosen, or the path is a pipe or a device.
    CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
        If it is not a stream that this build reads, or not even its first block is whole.
    MemoryLimitError
        If its mesh needs more memory than allowed. Reading raises it for blocks and frames.
    OSError
        If the file cannot be read.
    StoreError
        If a remote file is not there, cannot be reached, or its server gives no ranges of bytes.

    Examples
    --------
    >>> with meshreel.open("walk.reel") as reel:
    ...     frame, part = reel[1234], reel[100:200]
    ...     for frame in reel:
    ...         show(frame)
    """
    memory_limit(memory)  # a size that is none is no fault of the file
    with ExitStack() as on_error:
        file = on_error.enter_context(_opened(path))
        with errors_naming(path):
            reel = ReelFile(file, n_modes, memory, segment)
        on_error.pop_all()
    return reel


def read_info(
    path: str | os.PathLike[str],
    segment: int | None = None,
    memory: float | str | None = None,
) -> StreamInfo:
    """Contents of a `.reel` file of any number of segments, or of one of them.

    Parameters and errors are those of `open`.
    """
    limit = memory_limit(memory)
    with _opened(path) as file, errors_naming(path):
        whole = OpenFile(file, limit.limit_bytes)
        for one in whole.segments if segment is None else whole.segments[segment : segment + 1]:
            limit.require_mesh(one.n_verts, one.n_triangles)
        return file_info(whole, segment, limit, is_remote=is_remote(path))


def _opened(path: str | os.PathLike[str]) -> BinaryIO:
    if is_remote(path):
        return open_ranged(str(path))
    refuse_pipe(Path(path))
    return Path(path).open("rb")


def origin_of_file(path: str | os.PathLike[str]) -> Origin | None:
    """The origin that a `.reel` file states for its frames; None for any other file."""
    if Path(plain(path)).suffix.lower() != ".reel":
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
        sequence = decode(path.read_bytes(), memory=options.memory, progress=options.progress)
    options.progress("reading", 1.0)
    fps = sequence.fps if options.fps is None else options.fps
    if sequence.name and fps == sequence.fps:  # all positions would be checked again
        return sequence
    return replace(sequence, fps=fps, name=sequence.name or path.stem)
