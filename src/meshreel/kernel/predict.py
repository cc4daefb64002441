"""Prediction of fields over a mesh, by the core."""

import ctypes
import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.kernel.library import call, memory
from meshreel.kernel.mesh import Hierarchy
from meshreel.kernel.structures import fields_of
from meshreel.runtime.threads import in_threads, n_cores

CHUNK_VERTICES = 16384
"""Number of vertices of a level that one thread encodes. Each part has its own statistics, so that
the encoder's choices do not depend on the number of threads."""

BATCH_VERTICES = 16
"""Number of vertices that the core processes at once. Parts are multiples of it, so that prepared
weights fit any division of a level."""

MIN_VERTICES = 512
"""Minimum number of vertices that one thread prepares, which takes about a millisecond."""

MAX_JOINT = 8
"""Maximum number of modes that are quantized jointly."""

FIRST_COUNTS = 4.0 / (1.0 + np.arange(16))
"""Counts of the magnitudes of residuals before the first one; the last is for larger ones."""

_POINTER = ctypes.c_void_p

Prepared = npt.NDArray[np.uint8]
"""Prediction weights of all vertices before the first mode, in the core's layout."""


class _Mesh(ctypes.Structure):
    _fields_ = [
        *fields_of(ctypes.c_int64, "n_verts n_levels stencil_size"),
        *fields_of(_POINTER, "level_starts smooth_starts stencil hops smooth finest_smooth"),
    ]


class _Fields(ctypes.Structure):
    _fields_ = [
        *fields_of(ctypes.c_int64, "n_verts n_modes n_learned n_key"),
        *fields_of(_POINTER, "residuals values key prepared"),
    ]


class _Choice(ctypes.Structure):
    _fields_ = [
        ("first_shaped", ctypes.c_int64),
        *fields_of(ctypes.c_double, "gain rate_weight"),
        *fields_of(_POINTER, "target counts zones"),
        ("n_joint", ctypes.c_int64),
        *fields_of(_POINTER, "forms magnitudes"),
    ]


@dataclass(frozen=True)
class Choice:
    """Parameters of the encoder's choices."""

    first_shaped: int
    """First level with noise shaping."""
    gain: float
    """Gain of noise shaping."""
    rate_weight: float
    """Lagrange multiplier: squared error, in squared steps, per bit; 0 rounds to the nearest."""


def prepared_weights(mesh: Hierarchy, n_learned: int, key: Floats | None = None) -> Prepared:
    """Initial weights, shared by blocks with the same key or without one: 608 bytes per vertex."""
    n_levels = len(mesh.smooth_starts)
    prepared = memory("reel_predict_prepare_memory", len(mesh.order), n_levels)
    core_mesh = _mesh(mesh)
    fields = _fields(mesh, 0, n_learned, None, None, key, prepared)

    def fill(part: slice) -> None:
        arguments = ctypes.byref(core_mesh), ctypes.byref(fields)
        call("reel_predict_prepare", *arguments, part.start, part.stop, what="fields")

    stages = independent_parts(mesh, _prepared_part_sizes())
    in_threads(fill, [part for parts in stages for part in parts])
    return prepared


def encode_values(
    mesh: Hierarchy,
    target: Floats,
    choice: Choice,
    n_learned: int,
    key: Floats | None = None,
    prepared: Prepared | None = None,
    forms: npt.NDArray[np.float32] | None = None,
) -> tuple[npt.NDArray[np.int32], Floats]:
    """Encode fields; return residuals of shape (K, V) and their decoded values, of shape (V, K).

    Parameters
    ----------
    target : float64 array of shape (V, K)
        Values to approximate, in quantization steps.
    n_learned : int
        Number of modes that the weights adapt to.
    key : float64 array of shape (V, K of the key block), optional
        Values of the key block, in coding order like all arrays of this module.
    prepared : Prepared, optional
        `prepared_weights` of this mesh, key and `n_learned`; computed if None.
    forms : float32 array of shape (V, n (n + 1) / 2), optional
        Quadratic forms of the errors of the first n <= `MAX_JOINT` modes at each vertex, which are
        quantized jointly: for each mode k, the coefficients c of the modes before it, and its
        weight p, of the sum over k of p_k (e_k + sum of c_kj e_j)^2.

    Raises
    ------
    InvalidInputError
        If a residual is too large for a stream.
    """
    n_verts, n_modes = target.shape
    residuals, values = np.empty((n_modes, n_verts), np.int32), np.empty((n_verts, n_modes))
    target = np.ascontiguousarray(target)
    core_mesh = _mesh(mesh)
    fields = _fields(mesh, n_modes, n_learned, residuals, values, key, prepared)
    n_joint = 0 if forms is None else math.isqrt(2 * forms.shape[1])
    counts = np.concatenate([np.zeros(2 * n_modes), np.tile(FIRST_COUNTS, n_joint)])

    def run(part: slice) -> Floats:
        part_counts, zones = counts.copy(), np.empty(n_modes)
        arrays = map(_address, (target, part_counts, zones))
        joint = n_joint, _address(forms), _address(part_counts[2 * n_modes :])
        core_choice = _Choice(choice.first_shaped, choice.gain, choice.rate_weight, *arrays, *joint)
        arguments = map(ctypes.byref, (core_mesh, fields, core_choice))
        call("reel_predict_encode", *arguments, part.start, part.stop, what="fields")
        return part_counts

    for parts in independent_parts(mesh, lambda _: CHUNK_VERTICES):
        if len(parts) == 1:
            counts = run(parts[0])
            continue
        results = [counts] * len(parts)

        def fill(number: int, parts: list[slice] = parts, results: list[Floats] = results) -> None:
            results[number] = run(parts[number])

        in_threads(fill, range(len(parts)))
        counts = np.sum(results, axis=0)
    return residuals, values


def _mesh(mesh: Hierarchy) -> _Mesh:
    smooth, (n_verts, stencil_size) = mesh.smooth_future.result(), mesh.stencil.shape
    return _Mesh(
        n_verts,
        len(mesh.smooth_starts),
        stencil_size,
        _address(mesh.level_starts),
        _address(mesh.smooth_starts),
        _address(mesh.stencil),
        _address(mesh.hops),
        _address(smooth),
        _address(smooth[mesh.smooth_starts[-1] :]),
    )


def _fields(
    mesh: Hierarchy,
    n_modes: int,
    n_learned: int,
    residuals: npt.NDArray[np.int32] | None,
    values: Floats | None,
    key: Floats | None,
    prepared: Prepared | None,
) -> _Fields:
    n_key = 0 if key is None else key.shape[1]
    arrays = map(_address, (residuals, values, key, prepared))
    return _Fields(len(mesh.order), n_modes, n_learned, n_key, *arrays)


def _address(array: npt.NDArray[Any] | None) -> int | None:
    if array is None:
        return None
    assert array.flags.c_contiguous  # the core receives only its address
    return array.ctypes.data


def independent_parts(mesh: Hierarchy, size_of_parts: Callable[[int], int]) -> list[list[slice]]:
    """Divide the vertices into stages in coding order, whose parts are independent of each other.

    A stage is several small levels in one part, or one large level in parts whose size depends on
    that of the level.
    """
    stages: list[list[slice]] = [[]]
    for start, stop in pairwise(mesh.level_starts.tolist()):
        size = size_of_parts(stop - start)
        if stop - start > size:
            parts = range(start, stop, size)
            stages += [[slice(part, min(part + size, stop)) for part in parts], []]
        else:
            first = stages[-1][0].start if stages[-1] else start
            stages[-1] = [slice(first, stop)]
    return [parts for parts in stages if parts]


def _prepared_part_sizes() -> Callable[[int], int]:
    """The part size of a level whose weights are prepared, by its size: several parts per core."""
    n_parts = 4 * n_cores()

    def size_of_parts(n_verts: int) -> int:
        size = min(max(MIN_VERTICES, n_verts // n_parts), CHUNK_VERTICES)
        return -(-size // BATCH_VERTICES) * BATCH_VERTICES

    return size_of_parts
