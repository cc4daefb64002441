"""Decoding of many small segments in one call of the core, `core/reader/parts.h`.

Separate calls, ten for each segment, would hold the interpreter's lock as long as decoding takes.
"""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy.typing as npt

from meshreel.kernel.files import OpenFile
from meshreel.kernel.library import library
from meshreel.kernel.structures import OK, Error, fields_of


class _Part(ctypes.Structure):
    _fields_ = [
        ("file", ctypes.c_void_p),
        *fields_of(ctypes.c_uint32, "first count n_modes with_surface"),
        ("values", ctypes.POINTER(ctypes.c_void_p)),
        ("error", Error),
    ]


@dataclass(frozen=True)
class SegmentFrames:
    """Frames of an open segment."""

    file: OpenFile
    """File of one segment, which nothing else may use meanwhile."""
    first: int
    """First frame to decode."""
    values: list[npt.NDArray[Any]]
    """list of arrays of shape (T, N, C). One for each track, contiguous and of its number type;
    receives frames first..first+T-1.
    """
    n_modes: int
    """Number of modes by which positions move, as for `FrameDecoder`; 0: all."""
    with_surface: bool
    """Whether to decode the surface too."""


def decode_together(segments: Sequence[SegmentFrames]) -> None:
    """Decode mesh and frames of each segment on one thread.

    Parameters
    ----------
    segments : sequence of SegmentFrames
        At least one; all of one file in memory.

    Raises
    ------
    MeshReelError
        As `OpenFile` and `FrameDecoder`, for the first segment that fails.
    """
    parts = (_Part * len(segments))()
    for part, frames in zip(parts, segments, strict=True):
        assert all(values.flags.c_contiguous for values in frames.values)
        addresses = (ctypes.c_void_p * len(frames.values))(
            *(values.ctypes.data for values in frames.values)
        )
        part.file, part.first, part.count = frames.file.handle, frames.first, len(frames.values[0])
        part.n_modes, part.with_surface = frames.n_modes, frames.with_surface
        part.values = addresses
    library().reel_decode_parts(parts, ctypes.c_uint32(len(parts)))
    for part, frames in zip(parts, segments, strict=True):
        if part.error.code != OK:
            raise frames.file.failure(part.error)
