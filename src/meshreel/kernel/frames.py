"""Basis vectors over time from integers, and frames from fields and basis vectors, by the core.

A track has C columns: positions have x, y and z.
"""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.kernel.library import Argument, call, memory, size_of
from meshreel.runtime.threads import chunks, in_threads

Integers = npt.NDArray[np.integer]

COLUMNS = 0
"""REEL_COLUMNS of `core/reel.h`; layouts of values are the bytes of a number."""

SINGLE, DOUBLE = 4, 8
"""REEL_SUMS_4 and REEL_SUMS_8."""

VERTICES_AT_ONCE = 1 << 12
"""Vertices whose fields a thread packs at once; a multiple of 64."""

MAX_REST_BITS = 8
"""REEL_MAX_REST_BITS of `core/reel.h`."""

MAX_COSINES = 1024
"""REEL_MAX_COSINES of `core/reel.h`: most frames of a block with cosines over time."""

Flags = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Moves:
    """Displacements of single positions, in diagonals.

    Attributes
    ----------
    starts : int64 array of shape (n + 1,)
        Those of frame i are starts[i] : starts[i + 1] of the others.
    vertices : int32 array of shape (N,)
        Ascending in each frame.
    displacements : float64 array of shape (N, C)
    """

    starts: npt.NDArray[np.int64]
    vertices: npt.NDArray[np.int32]
    displacements: Floats

    def of_frames(self, frames: range) -> "Moves":
        """Those of a range of frames."""
        return Moves(self.starts[frames.start : frames.stop + 1], self.vertices, self.displacements)


def lengths_of(values: Floats, n_modes: int, finer: float) -> Floats:
    """Lengths of the first n_modes fields, of values of shape (V, K), divided by `finer`.

    The length of a field that is 0 is 1.
    """
    lengths = np.empty(n_modes)
    n_verts, n_there = values.shape
    given = np.ascontiguousarray(values, np.float64)
    call(
        "reel_lengths",
        given,
        n_verts,
        n_there,
        n_modes,
        ctypes.c_double(finer),
        lengths,
        what="lengths",
    )
    return lengths


def time_vectors(
    coded: Integers,
    lengths: Floats | None = None,
    rests: Flags | None = None,
    rest_bits: int = 0,
) -> Floats:
    """Basis vectors of shape (C, T, K), each of length 1 (or 0).

    Parameters
    ----------
    coded : integer array of shape (K, C, T)
        As in the stream: the coarsest times are differences.
    lengths : float64 array of shape (n,), optional
        What the first n vectors are divided by instead of their own lengths.
    rests : uint8 array of shape (T,), optional
        1 for each time that is predicted from the one before; never the first.
    rest_bits : int, default 0
        Integers of these times are divided by 2 to this power, at most `MAX_REST_BITS`.
    """
    divisors = np.zeros(0) if lengths is None else lengths
    n_modes, n_columns, n_frames = coded.shape
    basis = np.empty((n_columns, n_frames, n_modes))
    room = memory(size_of("reel_basis_memory", n_columns, n_frames))
    integers = np.ascontiguousarray(coded, np.int32)
    call(
        "reel_basis",
        room,
        len(room),
        integers,
        n_modes,
        n_columns,
        n_frames,
        rests,
        rest_bits,
        divisors,
        len(divisors),
        basis,
        what="basis vectors",
    )
    return basis


def encode_times(
    wanted: Floats, price: float, rests: Flags | None = None, rest_bits: int = 0
) -> npt.NDArray[np.int32]:
    """Integers of shape (K, C, T), as in the stream, of basis vectors near to wanted ones.

    Parameters
    ----------
    wanted : float64 array of shape (K, C, T)
        In steps.
    price : float
        Squared steps that a bit is worth; 0 rounds to the nearest.
    rests, rest_bits
        As of `time_vectors`.

    Raises
    ------
    InvalidInputError
        If an integer is too large for a stream.
    """
    n_modes, n_columns, n_frames = wanted.shape
    integers = np.empty(wanted.shape, np.int32)
    room = memory(size_of("reel_basis_encode_memory", n_frames))
    call(
        "reel_basis_encode",
        room,
        len(room),
        np.ascontiguousarray(wanted),
        n_modes,
        n_columns,
        n_frames,
        rests,
        rest_bits,
        ctypes.c_double(price),
        integers,
        what="basis vectors",
    )
    return integers


def cosine_vectors(coded: Integers, lengths: Floats | None = None) -> Floats:
    """Basis vectors of shape (C, T, K) as `time_vectors`, from coefficients of cosines over time.

    Parameters
    ----------
    coded : integer array of shape (K, C, T)
        Coefficients of an orthonormal discrete cosine transform (DCT-II), low frequencies first.
    lengths
        As of `time_vectors`.

    Raises
    ------
    InvalidInputError
        If there are more than `MAX_COSINES` frames, or none.
    """
    divisors = np.zeros(0) if lengths is None else lengths
    n_modes, n_columns, n_frames = coded.shape
    basis = np.empty((n_columns, n_frames, n_modes))
    work = memory(size_of("reel_cosine_basis_memory", n_columns, n_frames))
    call(
        "reel_cosine_basis",
        work,
        len(work),
        np.ascontiguousarray(coded, np.int32),
        n_modes,
        n_columns,
        n_frames,
        divisors,
        len(divisors),
        basis,
        what="basis vectors",
    )
    return basis


def encode_cosines(wanted: Floats, price: float) -> npt.NDArray[np.int32]:
    """Coefficients of shape (K, C, T), as `cosine_vectors` takes them.

    Parameters
    ----------
    wanted, price
        As of `encode_times`.

    Raises
    ------
    InvalidInputError
        If a coefficient is too large for a stream, or there are more than `MAX_COSINES` frames.
    """
    n_modes, n_columns, n_frames = wanted.shape
    integers = np.empty(wanted.shape, np.int32)
    work = memory(size_of("reel_cosines_encode_memory", n_frames))
    call(
        "reel_cosines_encode",
        work,
        len(work),
        np.ascontiguousarray(wanted),
        n_modes,
        n_columns,
        n_frames,
        ctypes.c_double(price),
        integers,
        what="basis vectors",
    )
    return integers


@dataclass(frozen=True)
class PackedFields:
    """Fields as the core multiplies them by basis vectors; from `packed_fields`.

    Attributes
    ----------
    is_single : bool
        Products are summed up in IEEE single precision, and not in double.
    data : uint8 array
    """

    n_modes: int
    n_verts: int
    is_single: bool
    data: npt.NDArray[np.uint8]

    @property
    def precision(self) -> int:
        """A `reel_precision` of the core."""
        return SINGLE if self.is_single else DOUBLE


def packed_fields(
    fields: Floats,
    *,
    step: float = 1.0,
    is_single: bool = False,
    order: Integers | None = None,
) -> PackedFields:
    """Fields packed for any number of products, on all cores.

    Parameters
    ----------
    fields : float64 array of shape (K, V)
        The view of an array of shape (V, K) serves as well.
    step : float
        Fields are multiplied by it.
    is_single : bool, default False
        Fields and basis vectors are rounded to IEEE single precision, and products summed up in it.
    order : integer array of shape (V,), optional
        The vertex of the fields that each packed vertex is.

    Raises
    ------
    InvalidInputError
        If the order names a vertex that is not there.
    """
    fields = np.asarray(fields, np.float64)
    n_modes, n_verts = fields.shape
    precision = SINGLE if is_single else DOUBLE
    found = memory(size_of("reel_packed_bytes", n_modes, n_verts, precision))
    places = None if order is None else np.ascontiguousarray(order, np.int32)

    def pack(piece: slice) -> None:
        call(
            "reel_pack",
            ctypes.c_void_p(fields.ctypes.data),
            *(stride // fields.itemsize for stride in fields.strides),
            ctypes.c_double(step),
            precision,
            places,
            n_modes,
            n_verts,
            piece.start,
            piece.stop,
            found,
            what="fields",
        )

    in_threads(pack, chunks(n_verts, VERTICES_AT_ONCE))
    return PackedFields(n_modes, n_verts, is_single, found)


def frame_columns(basis: Floats, fields: PackedFields, frames: range) -> Floats:
    """Matrices of shape (C, frames, V): sums over the modes.

    Parameters
    ----------
    basis : float64 array of shape (C, T, K)
    fields : PackedFields
        K of V vertices.
    """
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
) -> None:
    """Fill an array with values of frames: (sum over modes + move) times scale plus origin.

    Parameters
    ----------
    out : contiguous float32 or float64 array of shape (n, V, C)
    basis : float64 array of shape (C, T, K)
    fields : PackedFields
        K of V vertices.
    frames : range
        The n frames.
    placement : 1 + C floats
        Scale, and the origin of each column.
    moves : Moves, optional
        Of these frames, and vertices of `out`.

    Raises
    ------
    InvalidInputError
        If a frame is not there.
    """
    placed = np.array(placement, np.float64)
    _frames(basis, fields, frames, moves, placed, out, out.itemsize)


def coordinate_rows(
    vertices: npt.NDArray[np.floating],
    order: Integers | None,
    piece: slice,
    placement: Sequence[float],
) -> Floats:
    """Values of some vertices, such as coordinates, less the origin and divided by the scale.

    Parameters
    ----------
    vertices : contiguous float32 or float64 array of shape (T, V, C)
    order : contiguous int32 array of shape (V,), or None
        The vertex that stands at each place; None: its own.
    piece : slice
        Places, n of them.
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
    """Add what `coordinate_rows` gives, times a sign of each place, shape (n,), to contiguous rows
    of shape (C T, n).
    """
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
) -> None:
    n_columns, n_frames, n_modes = basis.shape
    assert n_modes == fields.n_modes
    moved: tuple[Argument, ...] = (None, None, None)
    if moves is not None:
        moved = (moves.starts, moves.vertices, moves.displacements)
    room = memory(size_of("reel_frames_memory", n_columns, n_modes, len(frames)))
    call(
        "reel_frames",
        room,
        len(room),
        np.ascontiguousarray(basis, np.float64),
        fields.data,
        fields.precision,
        n_columns,
        n_frames,
        n_modes,
        fields.n_verts,
        np.array(frames, np.int32),
        len(frames),
        *moved,
        placement,
        layout,
        out,
        what="frames",
    )
