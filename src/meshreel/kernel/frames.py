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
from meshreel.kernel.library import Argument, call, memory, size_of
from meshreel.runtime.threads import chunks, in_threads

Integers = npt.NDArray[np.integer]

COLUMNS = 0
"""REEL_COLUMNS of `core/reel.h`; other layouts are the bytes per number."""

SINGLE, DOUBLE = 4, 8
"""REEL_SUMS_4 and REEL_SUMS_8."""

VERTICES_AT_ONCE = 1 << 12
"""Number of vertices that a thread packs at once; a multiple of 64."""


@dataclass(frozen=True)
class Moves:
    """Displacements of single positions, in diagonals.

    Attributes
    ----------
    starts : int64 array of shape (n + 1,)
        Frame i has the entries starts[i] : starts[i + 1] of the other arrays.
    vertices : int32 array of shape (N,)
        Ascending in each frame.
    displacements : float64 array of shape (N, C)
    """

    starts: npt.NDArray[np.int64]
    vertices: npt.NDArray[np.int32]
    displacements: Floats

    def of_frames(self, frames: range) -> "Moves":
        """The displacements of a range of frames."""
        return Moves(self.starts[frames.start : frames.stop + 1], self.vertices, self.displacements)


@dataclass(frozen=True)
class PackedFields:
    """Fields in the core's layout for products with basis vectors, from `packed_fields`.

    Attributes
    ----------
    n_modes, n_verts : int
    precision : int
        Precision of sums, a `reel_precision` of the core.
    data : uint8 array
    """

    n_modes: int
    n_verts: int
    precision: int
    data: npt.NDArray[np.uint8]


def packed_fields(
    fields: Floats,
    *,
    step: float = 1.0,
    is_single: bool = False,
    order: Integers | None = None,
) -> PackedFields:
    """Pack fields for any number of products, on all cores.

    Parameters
    ----------
    fields : float64 array of shape (K, V)
        May be a transposed view.
    step : float
        Fields are multiplied by it.
    is_single : bool, default False
        Round fields and basis vectors to IEEE single precision, and sum products in it.
    order : integer array of shape (V,), optional
        Vertex of the fields for each packed vertex.

    Raises
    ------
    InvalidInputError
        If the order contains a vertex that does not exist.
    """
    fields = np.asarray(fields, np.float64)
    n_modes, n_verts = fields.shape
    precision = SINGLE if is_single else DOUBLE
    packed = memory(size_of("reel_packed_bytes", n_modes, n_verts, precision))
    order = None if order is None else np.ascontiguousarray(order, np.int32)

    def pack(piece: slice) -> None:
        call(
            "reel_pack",
            ctypes.c_void_p(fields.ctypes.data),
            *(stride // fields.itemsize for stride in fields.strides),
            ctypes.c_double(step),
            precision,
            order,
            n_modes,
            n_verts,
            piece.start,
            piece.stop,
            packed,
            what="fields",
        )

    in_threads(pack, chunks(n_verts, VERTICES_AT_ONCE))
    return PackedFields(n_modes, n_verts, precision, packed)


def frame_columns(basis: Floats, fields: PackedFields, frames: range) -> Floats:
    """Products of a basis of shape (C, T, K) and K fields, of shape (C, frames, V)."""
    out = np.empty((len(basis), len(frames), fields.n_verts))
    _frames(basis, fields, frames, None, None, out, COLUMNS)
    return out


def fill_values(
    out: npt.NDArray[np.floating],
    basis: Floats,
    fields: PackedFields,
    frames: range,
    placement: Sequence[float],
    moves: Moves | None = None,
) -> bool:
    """Fill an array with values of frames: (sum over modes + move) times scale plus origin.

    Returns whether all values are finite.

    Parameters
    ----------
    out : contiguous float32 or float64 array of shape (n, V, C)
    basis : float64 array of shape (C, T, K)
    fields : PackedFields
        K fields of V vertices.
    frames : range
        The n frames.
    placement : 1 + C floats
        Scale, and the origin of each column.
    moves : Moves, optional
        Moves of these frames; vertices are indices into `out`.

    Raises
    ------
    InvalidInputError
        If a frame does not exist.
    """
    return _frames(basis, fields, frames, moves, np.array(placement, np.float64), out, out.itemsize)


@dataclass(frozen=True)
class JointFrames:
    """Frames as the product of a temporal basis and fields that all columns share.

    Results are bit-identical on every machine.

    Attributes
    ----------
    basis : float64 array of shape (C, T, K)
        C columns; positions have x, y and z.
    values : float64 array of shape (V, K)
        Fields in steps.
    step : float
    order : integer array of shape (V,)
        Row of `values` of each vertex of the frames.
    is_single : bool, default False
        Sum products in IEEE single precision, not in double.
    """

    basis: Floats
    values: Floats
    step: float
    order: Integers
    is_single: bool = False

    def __call__(self, frames: slice) -> Floats:
        """Return coordinate matrices of shape (C, frames, V) of a range of frames."""
        numbers = range(*frames.indices(self.basis.shape[1]))
        return frame_columns(self.basis, self.packed, numbers)

    @cached_property
    def packed(self) -> PackedFields:
        """Packed fields, computed once."""
        return packed_fields(
            self.values.T, step=self.step, is_single=self.is_single, order=self.order
        )

    def pack(self) -> None:
        """Pack the fields now, on all cores, before threads call `fill`."""
        _ = self.packed

    def fill(
        self,
        out: npt.NDArray[np.floating],
        frames: range,
        placement: Sequence[float],
        moves: Moves | None = None,
    ) -> None:
        """Fill a contiguous array of shape (n, V, C) with values of n frames, in model units.

        The placement is the scale, and the origin of each column. The result is bit-identical to
        `from_matrices` of ``self(frames)``.
        """
        fill_values(out, self.basis, self.packed, frames, placement, moves)


def coordinate_rows(
    vertices: npt.NDArray[np.floating],
    order: Integers | None,
    piece: slice,
    placement: Sequence[float],
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

    Returns
    -------
    float64 array of shape (C T, n): the first column at all frames, then the next
    """
    n_frames, _, n_columns = vertices.shape
    out = np.empty((n_columns * n_frames, piece.stop - piece.start))
    _coordinates(vertices, order, piece, placement, None, out)
    return out


def add_coordinate_rows(
    vertices: npt.NDArray[np.floating],
    order: Integers | None,
    piece: slice,
    placement: Sequence[float],
    signs: Floats,
    out: Floats,
) -> None:
    """Add `coordinate_rows`, times signs of shape (n,), to contiguous rows of shape (C T, n)."""
    _coordinates(vertices, order, piece, placement, signs, out)


def _coordinates(
    vertices: npt.NDArray[np.floating],
    order: Integers | None,
    piece: slice,
    placement: Sequence[float],
    signs: Floats | None,
    out: Floats,
) -> None:
    n_frames, n_verts, n_columns = vertices.shape
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
        what="positions",
    )


def _frames(
    basis: Floats,
    fields: PackedFields,
    frames: range,
    moves: Moves | None,
    placement: Floats | None,
    out: npt.NDArray[np.floating],
    layout: int,
) -> bool:
    n_columns, n_frames, n_modes = basis.shape
    assert n_modes == fields.n_modes
    move_arrays: tuple[Argument, ...] = (None, None, None)
    if moves is not None:
        move_arrays = (moves.starts, moves.vertices, moves.displacements)
    are_finite = call(
        "reel_frames",
        np.ascontiguousarray(basis, np.float64),
        fields.data,
        fields.precision,
        n_columns,
        n_frames,
        n_modes,
        fields.n_verts,
        np.array(frames, np.int32),
        len(frames),
        *move_arrays,
        placement,
        layout,
        out,
        what="frames",
        memory_of=("reel_frames_memory", n_columns, n_modes, len(frames)),
    )
    return bool(are_finite)
