"""The common part of point caches: float32 positions, frame after frame, behind a header."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.file_errors import os_errors_naming
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.frames.stored_frames import changed_error
from meshreel.model.sequence import Vertices
from meshreel.runtime.counting import counted

FRAME_RATE = 24.0  # of what has none, where a file needs one
VERTEX_BYTES = 12


def check_cache_size(header_bytes: int, n_frames: int, n_verts: int, size_bytes: int) -> None:
    """Refuse a point cache whose size is not what its header says.

    Raises
    ------
    FormatError
        Naming both sizes.
    """
    if n_frames < 1 or n_verts < 1:
        raise FormatError(
            f"says that it holds {counted(n_frames, 'frame')} of {counted(n_verts, 'vertex')}"
        )
    expected = header_bytes + n_frames * n_verts * VERTEX_BYTES
    if size_bytes != expected:
        problem = "is cut short" if size_bytes < expected else "is damaged"
        raise FormatError(
            f"{problem}: {counted(n_frames, 'frame')} of {counted(n_verts, 'vertex')} take "
            f"{expected} bytes; "
            f"the file has {size_bytes}"
        )


def cache_reader(
    path: Path, header_bytes: int, n_verts: int, number: str
) -> Callable[[int, int], Vertices]:
    """A function from a start and a stop to those frames of a point cache, as native float32.

    Parameters
    ----------
    header_bytes : int
        Where the first frame begins.
    number : {"<f4", ">f4"}
        How the file writes a number.
    """

    def read(start: int, stop: int) -> Vertices:
        width = n_verts * 3
        offset = header_bytes + start * n_verts * VERTEX_BYTES
        with os_errors_naming(path):
            numbers = np.fromfile(path, number, (stop - start) * width, offset=offset)
        if len(numbers) < (stop - start) * width:
            raise changed_error(f"{path} (frame {start + len(numbers) // width})")
        return numbers.reshape(-1, n_verts, 3).astype(np.float32, copy=False)

    return read


def single_precision(stream: FrameStream) -> Iterator[Vertices]:
    """Each frame in float32; a note says by how much that moves vertices, if it does.

    Raises
    ------
    InvalidInputError
        Naming the frame that is too large for float32.
    """
    furthest = 0.0
    for index, frame in enumerate(stream.frames()):
        with np.errstate(over="ignore", under="ignore"):
            rounded: Vertices = frame.astype(np.float32, copy=False)
        if rounded is not frame:
            if not np.isfinite(rounded).all():
                raise InvalidInputError(
                    f"frame {index} reaches to {np.abs(frame).max():g}; point caches hold "
                    "float32, up to 3.4e38; scale the model down"
                )
            furthest = max(furthest, float(np.abs(rounded - frame).max()))
        yield rounded
    if furthest > 0:
        stream.notes.append(f"positions were rounded to float32, by up to {furthest:.3g}")
