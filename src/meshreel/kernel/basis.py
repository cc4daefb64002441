"""Coding of basis vectors over time, as values or as cosine coefficients, by the core.

A track has C columns: positions have x, y and z.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.kernel.fields import CodingOrder
from meshreel.kernel.library import Argument, call, int32s

MAX_REST_BITS = 8
"""REEL_MAX_REST_BITS of `core/reel.h`."""

MAX_COSINES = 1024
"""REEL_MAX_COSINES of `core/reel.h`: maximum number of frames of a block with cosines."""

MAX_TIME_PASSES, MAX_NEAR_TIMES = 4, 6
"""REEL_MAX_TIME_PASSES and REEL_MAX_NEAR_TIMES of `core/reel.h`."""

TIME_STRIDE = 4
"""Distance of the times that are coded first, as in `core/timeline.c`."""


@dataclass(frozen=True)
class Rests:
    """Times of a block with little or no motion."""

    runs: tuple[tuple[int, int], ...] = ()
    """Start and end of each run of resting times, ascending; a moving time
    precedes each run.
    """
    bits: int = 0
    """Integers of resting times are divided by 2 to this power, at most `MAX_REST_BITS`."""

    def flags(self, n_frames: int) -> npt.NDArray[np.uint8] | None:
        """Array of shape (n_frames,) with 1 for each resting time; None without rests."""
        if not self.runs:
            return None
        flags = np.zeros(n_frames, np.uint8)
        for start, end in self.runs:
            flags[start:end] = 1
        return flags


NO_REST = Rests()


@dataclass(frozen=True)
class BasisCoding:
    """How the basis vectors of a block become integers."""

    rests: Rests = NO_REST
    """Times predicted from the previous time; none with cosines."""
    has_cosines: bool = False
    """Integers are coefficients of an orthonormal discrete cosine transform over time (DCT-II), low
    frequencies first, instead of values.
    """
    is_adaptive: bool = False
    """The prediction weights of moving times adapt to decoded values; not with cosines."""


BY_TIMES = BasisCoding()

QuantizedBasis = tuple[npt.NDArray[np.int32], Floats]
"""Integers of the stream, and the vectors that they decode to."""


@lru_cache(maxsize=8)
def time_order(n_columns: int, n_frames: int, coding: BasisCoding = BY_TIMES) -> CodingOrder:
    """Return the coding order of the integers of a basis vector of shape (C, T)."""
    n_integers = n_columns * n_frames
    columns, near_starts = np.empty(n_integers, np.int32), np.empty(n_integers + 1, np.int64)
    pass_starts = np.empty(MAX_TIME_PASSES + 1, np.int64)
    near = np.empty(MAX_NEAR_TIMES * n_integers, np.int32)
    n_passes = call(
        "reel_time_order",
        n_columns,
        n_frames,
        int(coding.has_cosines),
        coding.rests.flags(n_frames),
        columns,
        pass_starts,
        near_starts,
        near,
        noun="times",
        memory_of=("reel_time_order_memory", n_frames),
    )
    near = near[: near_starts[-1]].copy()
    return CodingOrder(
        n_integers, columns, pass_starts[: n_passes + 1], n_passes, near_starts, near
    )


def lengths_of(values: Floats, n_modes: int, finer: float) -> Floats:
    """Return the lengths of the first n_modes fields of shape (V, K), divided by `finer`.

    The length of a zero field is 1.
    """
    lengths = np.empty(n_modes)
    n_verts, n_fields = values.shape
    call(
        "reel_lengths",
        np.ascontiguousarray(values, np.float64),
        n_verts,
        n_fields,
        n_modes,
        float(finer),
        lengths,
        noun="lengths",
    )
    return lengths


def basis_vectors(
    integers: npt.NDArray[np.integer], coding: BasisCoding = BY_TIMES, lengths: Floats | None = None
) -> Floats:
    """Decode basis vectors of shape (C, T, K), each of length 1 (or 0).

    Parameters
    ----------
    integers : int32 array of shape (K, C, T)
        As in the stream.
    lengths : float64 array of shape (n,), optional
        Divisors of the first n vectors, instead of their lengths.

    Raises
    ------
    InvalidInputError
        If cosines are used with 0 or more than `MAX_COSINES` frames.
    """
    n_modes, n_columns, n_frames = integers.shape
    basis = np.empty((n_columns, n_frames, n_modes))
    divisors = np.zeros(0) if lengths is None else lengths
    name = "reel_cosine_basis" if coding.has_cosines else "reel_basis"
    options = _options_of_times(coding, n_frames)
    call(
        name,
        int32s(integers),
        n_modes,
        n_columns,
        n_frames,
        *options,
        divisors,
        len(divisors),
        basis,
        noun="basis vectors",
        memory_of=(f"{name}_memory", n_columns, n_frames),
    )
    return basis


def quantized_basis(
    targets: Floats,
    rate_weight: float,
    coding: BasisCoding = BY_TIMES,
    lengths: Floats | None = None,
) -> QuantizedBasis:
    """Quantize basis vectors; return their integers and what they decode to.

    Parameters
    ----------
    targets : float64 array of shape (K, C, T)
        The basis vectors, in quantization steps.
    rate_weight : float
        Lagrange multiplier: squared error, in squared steps, per bit; 0 rounds to the nearest.
    lengths : float64 array of shape (n,), optional
        As in `basis_vectors`.

    Returns
    -------
    integers : int32 array of shape (K, C, T)
    vectors : float64 array of shape (C, T, K)
        As `basis_vectors` decodes them.

    Raises
    ------
    InvalidInputError
        If an integer is too large for a stream, or cosines are used with more than `MAX_COSINES`
        frames.
    """
    n_modes, n_columns, n_frames = shape = targets.shape
    targets, noun = np.ascontiguousarray(targets), "basis vectors"
    divisors = np.zeros(0) if lengths is None else lengths
    options = _options_of_times(coding, n_frames)
    integers, vectors = np.empty(shape, np.int32), np.empty((n_columns, n_frames, n_modes))
    encode, decode = "reel_basis_encode", "reel_basis"
    if coding.has_cosines:
        encode, decode = "reel_cosines_encode", "reel_cosine_basis"
    call(
        encode, targets, *shape, *options, float(rate_weight), integers,
        noun=noun, memory_of=(f"{encode}_memory", n_frames),
    )  # fmt: skip
    call(
        decode, integers, *shape, *options, divisors, len(divisors), vectors,
        noun=noun, memory_of=(f"{decode}_memory", n_columns, n_frames),
    )  # fmt: skip
    return integers, vectors


def _options_of_times(coding: BasisCoding, n_frames: int) -> tuple[Argument, ...]:
    """Return the extra arguments of functions that code values instead of cosines."""
    if coding.has_cosines:
        return ()
    return coding.rests.flags(n_frames), coding.rests.bits, int(coding.is_adaptive)
