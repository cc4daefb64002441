"""Prediction of fields over a mesh, by the core."""

import ctypes
import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.kernel.library import call
from meshreel.kernel.mesh import Hierarchy
from meshreel.kernel.structures import fields_of
from meshreel.runtime.threads import in_chunks, in_threads

CHUNK_VERTICES = 16384
"""Number of vertices of a level that one thread encodes. Each part has its own statistics, so that
the encoder's choices do not depend on the number of threads."""

MAX_RELATED = 4
"""Maximum number of fields of a related track that a prediction uses."""

MAX_JOINT = 8
"""Maximum number of modes that are quantized jointly."""

FIRST_COUNTS = 4.0 / (1.0 + np.arange(16))
"""Initial counts of the residual magnitudes 0..14, and of all larger ones."""

_POINTER = ctypes.c_void_p


class _Mesh(ctypes.Structure):
    _fields_ = [
        *fields_of(ctypes.c_int64, "n_verts n_levels stencil_size"),
        *fields_of(_POINTER, "level_starts smooth_starts stencil hops smooth weights"),
    ]


class _Fields(ctypes.Structure):
    _fields_ = [
        *fields_of(ctypes.c_int64, "n_verts n_modes n_learned n_key"),
        *fields_of(_POINTER, "residuals values key"),
        ("n_related", ctypes.c_int64),
        *fields_of(_POINTER, "related regression"),
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


def encode_values(
    mesh: Hierarchy,
    target: Floats,
    choice: Choice,
    n_learned: int,
    key: Floats | None = None,
    forms: npt.NDArray[np.float32] | None = None,
    weights: npt.NDArray[np.float32] | None = None,
    related: Floats | None = None,
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
    forms : float32 array of shape (V, n (n + 1) / 2), optional
        Quadratic forms of the errors of the first n <= `MAX_JOINT` modes at each vertex, which are
        quantized jointly: for each mode k, the coefficients c of the modes before it, and its
        weight p, of the sum over k of p_k (e_k + sum of c_kj e_j)^2.
    weights : float32 array of shape (V, S), optional
        Initial weights, from `kriging_weights`; the default derives them from the graph.
    related : float64 array of shape (V, up to `MAX_RELATED`), optional
        Fields of a related track; requires `weights`.

    Raises
    ------
    InvalidInputError
        If a residual is too large for a stream.
    """
    n_verts, n_modes = target.shape
    residuals, values = np.empty((n_modes, n_verts), np.int32), np.empty((n_verts, n_modes))
    target = np.ascontiguousarray(target)
    starts = mesh.level_starts, mesh.smooth_starts
    arrays = map(_address, (*starts, mesh.stencil, mesh.hops, mesh.smooth, weights))
    core_mesh = _Mesh(n_verts, len(mesh.smooth_starts), mesh.stencil.shape[1], *arrays)
    n_key = 0 if key is None else key.shape[1]
    results_and_key = map(_address, (residuals, values, key))
    n_related = 0 if related is None else related.shape[1]
    regression = np.empty(n_related * (n_related + 2 * n_modes))
    relation = n_related, _address(related), _address(regression)
    fields = _Fields(n_verts, n_modes, n_learned, n_key, *results_and_key, *relation)
    n_joint = 0 if forms is None else math.isqrt(2 * forms.shape[1])
    counts = np.concatenate([np.zeros(2 * n_modes), np.tile(FIRST_COUNTS, n_joint)])

    def run(part: slice) -> Floats:
        part_counts, zones = counts.copy(), np.empty(n_modes)
        arrays = map(_address, (target, part_counts, zones))
        joint = n_joint, _address(forms), _address(part_counts[2 * n_modes :])
        core_choice = _Choice(choice.first_shaped, choice.gain, choice.rate_weight, *arrays, *joint)
        arguments = map(ctypes.byref, (core_mesh, fields, core_choice))
        call("reel_predict_encode", *arguments, part.start, part.stop, noun="fields")
        return part_counts

    stages = independent_parts(mesh) if related is None else [[slice(0, n_verts)]]
    for parts in stages:
        if len(parts) == 1:
            counts = run(parts[0])
            continue
        results = [counts] * len(parts)

        def fill(number: int, parts: list[slice] = parts, results: list[Floats] = results) -> None:
            results[number] = run(parts[number])

        in_threads(fill, range(len(parts)))
        counts = np.sum(results, axis=0)
    return residuals, values


def kriging_weights(
    mesh: Hierarchy | npt.NDArray[np.int32], points: Floats, nugget: float
) -> npt.NDArray[np.float32]:
    """Weights of the stencils from points, of shape (V, S); 0 without a stencil.

    Parameters
    ----------
    mesh : Hierarchy, or int32 array of shape (V, S)
        Or only the stencils: numbers of points, padded with -1.
    points : float64 array of shape (V, 3)
        In coding order.
    nugget : float
        Variance of the noise of a value, relative to that of the field at the mean distance of a
        stencil; above 0.
    """
    stencils = mesh.stencil if isinstance(mesh, Hierarchy) else mesh
    weights, (n_points, size) = np.empty(stencils.shape, np.float32), stencils.shape
    core_mesh = _Mesh(n_points, 0, size, None, None, _address(stencils), None, None, None)
    points = np.ascontiguousarray(points, np.float64)

    def fill(part: slice) -> None:
        ends = part.start, part.stop
        call(
            "reel_kriging", ctypes.byref(core_mesh), points, nugget, *ends, weights, noun="weights"
        )

    in_chunks(fill, n_points, CHUNK_VERTICES)
    return weights


def _address(array: npt.NDArray[Any] | None) -> int | None:
    if array is None:
        return None
    assert array.flags.c_contiguous  # the core receives only its address
    return array.ctypes.data


def independent_parts(mesh: Hierarchy) -> list[list[slice]]:
    """Divide the vertices into stages in coding order, whose parts are independent of each other.

    A stage is several small levels in one part, or one large level in parts of `CHUNK_VERTICES`.
    """
    stages: list[list[slice]] = [[]]
    for start, stop in pairwise(mesh.level_starts.tolist()):
        if stop - start > CHUNK_VERTICES:
            parts = range(start, stop, CHUNK_VERTICES)
            stages += [[slice(part, min(part + CHUNK_VERTICES, stop)) for part in parts], []]
        else:
            first = stages[-1][0].start if stages[-1] else start
            stages[-1] = [slice(first, stop)]
    return [parts for parts in stages if parts]
