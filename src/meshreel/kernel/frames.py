"""Products of fields and basis vectors over time, by the core.

A track has C columns: positions have x, y and z.
"""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.kernel.library import Argument, call, int32s, memory
from meshreel.runtime.threads import in_chunks

Integers = npt.NDArray[np.integer]

COLUMNS = 0
"""REEL_COLUMNS of `core/reel.h`; other layouts are the bytes per number."""

SINGLE, DOUBLE = 4, 8
"""REEL_SUMS_4 and REEL_SUMS_8."""

VERTS_PER_CHUNK = 1 << 12
"""Vertices that a thread packs at a time; a multiple of 64."""


@dataclass(frozen=True)
class FrameCorrections:
    """Displacements of single positions, in diagonals."""

    starts: npt.NDArray[np.int64]
    """int64 array of shape (n + 1,). Frame i has the entries starts[i] : starts[i + 1] of the other
    arrays.
    """
    vertices: npt.NDArray[np.int32]
    """int32 array of shape (N,). Ascending in each frame."""
    displacements: Floats
    """float64 array of shape (N, C)."""

    def of_frames(self, frames: range) -> "FrameCorrections":
        """The displacements of a range of frames."""
        return FrameCorrections(
            self.starts[frames.start : frames.stop + 1], self.vertices, self.displacements
        )


@dataclass(frozen=True)
class JointFrames:
    """Frames as the product of a temporal basis and fields that all columns share.

    Results are bit-identical on every machine.

    Raises
    ------
    InvalidInputError
        When fields are packed, if the order contains a row that does not exist; by all methods, if
        a frame does not exist.
    """

    basis: Floats
    """float64 array of shape (C, T, K). C columns; positions have x, y and z."""
    values: Floats
    """float64 array of shape (V, K). Fields in steps; may be a transposed view."""
    step: float = 1.0
    order: Integers | None = None
    """Integer array of shape (V,). Row of `values` of each decoded vertex; None: the identity."""
    is_single: bool = False
    """Round fields and basis vectors to IEEE single precision, and sum products in it."""

    def __call__(self, frames: slice) -> Floats:
        """Return coordinate matrices of shape (C, frames, V) of a range of frames."""
        return self.columns(range(*frames.indices(self.basis.shape[1])))

    def columns(self, frames: range) -> Floats:
        """Return sums over the modes, of shape (C, frames, V)."""
        out = np.empty((len(self.basis), len(frames), len(self.values)))
        self._compute(frames, None, None, out, COLUMNS)
        return out

    def fill(
        self,
        out: npt.NDArray[np.floating],
        frames: range,
        placement: Sequence[float],
        corrections: FrameCorrections | None = None,
    ) -> bool:
        """Fill an array with frames: (sum over modes + correction) times scale plus origin.

        Returns whether all values are finite.

        Parameters
        ----------
        out : contiguous float32 or float64 array of shape (n, V, C)
        frames : range
            The n frames.
        placement : 1 + C floats
            Scale, and the origin of each column.
        corrections : FrameCorrections, optional
            Those of these frames; vertices are indices into `out`.
        """
        return self._compute(
            frames, corrections, np.array(placement, np.float64), out, out.itemsize
        )

    def pack(self) -> None:
        """Pack the fields now, on all cores, before threads call `fill`."""
        _ = self._packed

    @cached_property
    def _packed(self) -> npt.NDArray[np.uint8]:
        """The fields in the core's layout."""
        values = np.asarray(self.values, np.float64)
        (n_verts, n_modes), (vertex_stride, mode_stride) = values.shape, values.strides
        packed = memory("reel_packed_bytes", n_modes, n_verts, self._precision)
        order = None if self.order is None else int32s(self.order)
        arguments = (
            ctypes.c_void_p(values.ctypes.data),
            mode_stride // values.itemsize,
            vertex_stride // values.itemsize,
            float(self.step),
            self._precision,
            order,
            n_modes,
            n_verts,
            packed,
        )

        def pack(piece: slice) -> None:
            call("reel_pack", *arguments, piece.start, piece.stop, noun="fields")

        if 0 < n_verts <= VERTS_PER_CHUNK:
            pack(slice(0, n_verts))
        else:
            in_chunks(pack, n_verts, VERTS_PER_CHUNK)
        return packed

    @cached_property
    def _precision(self) -> int:
        return SINGLE if self.is_single else DOUBLE

    def _compute(
        self,
        frames: range,
        corrections: FrameCorrections | None,
        placement: Floats | None,
        out: npt.NDArray[np.floating],
        layout: int,
    ) -> bool:
        n_columns, n_frames, n_modes = self.basis.shape
        arrays: tuple[Argument, ...] = (None, None, None)
        if corrections is not None:
            arrays = (corrections.starts, corrections.vertices, corrections.displacements)
        are_finite = call(
            "reel_frames",
            np.ascontiguousarray(self.basis, np.float64),
            self._packed,
            self._precision,
            n_columns,
            n_frames,
            n_modes,
            len(self.values),
            np.array(frames, np.int32),
            len(frames),
            *arrays,
            placement,
            layout,
            out,
            noun="frames",
            memory_of=("reel_frames_memory", n_columns, n_modes, len(frames)),
        )
        return bool(are_finite)


def coordinate_rows(
    vertices: npt.NDArray[np.floating],
    order: Integers | None,
    piece: slice,
    placement: Sequence[float],
    signs: Floats | None = None,
    out: Floats | None = None,
) -> Floats:
    """Normalized values of some vertices: minus the origin, divided by the scale.

    Parameters
    ----------
    vertices : contiguous float32 or float64 array of shape (T, V, C)
    order : contiguous int32 array of shape (V,), or None
        The vertex at each index of the result; None means the identity.
    piece : slice
        The n indices to return.
    placement : 1 + C floats
        Scale, and the origin of each column.
    signs, out : float64 arrays of shapes (n,) and (C T, n), optional
        Add the values times signs to `out`, instead of a new array.

    Returns
    -------
    float64 array of shape (C T, n): the first column at all frames, then the next
    """
    n_frames, n_verts, n_columns = vertices.shape
    if out is None:
        out = np.empty((n_columns * n_frames, piece.stop - piece.start))
    call(
        "reel_coordinates",
        vertices,
        vertices.itemsize,
        n_frames,
        n_verts,
        n_columns,
        order,
        piece.start,
        piece.stop,
        np.array(placement, np.float64),
        signs,
        out,
        noun="positions",
    )
    return out
