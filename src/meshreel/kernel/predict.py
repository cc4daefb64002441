"""Prediction of fields over a mesh, by the core: residuals to values, and values to residuals."""

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.kernel.library import call, memory, size_of
from meshreel.kernel.mesh import Hierarchy
from meshreel.runtime.threads import in_threads, n_cores

CHUNK_VERTICES = 16384
"""Vertices of a level that one thread takes; the encoder counts in each by itself, so that its
choices do not depend on the number of threads."""

BATCH_VERTICES = 16
"""Vertices that the core takes at once: parts are whole numbers of these, for what is prepared in
one way of parting a level serves in every other."""

LEAST_VERTICES = 512
"""Fewest of a level that one thread takes where nothing is counted: about a millisecond."""

Prepared = npt.NDArray[np.uint8]
"""What is known about the weights of all vertices before the first mode, as the core has it."""


class _Mesh(ctypes.Structure):
    _fields_ = [
        *((name, ctypes.c_int64) for name in ("n_verts", "n_levels", "stencil_size")),
        *(
            (name, ctypes.c_void_p)
            for name in ("level_starts", "smooth_starts", "stencil", "hops", "smooth")
        ),
    ]


class _Fields(ctypes.Structure):
    _fields_ = [
        *((name, ctypes.c_int64) for name in ("n_verts", "n_modes", "n_learned", "n_key")),
        *((name, ctypes.c_void_p) for name in ("residuals", "values", "key", "prepared")),
    ]


class _Choice(ctypes.Structure):
    _fields_ = [
        ("first_shaped", ctypes.c_int64),
        ("gain", ctypes.c_double),
        ("price", ctypes.c_double),
        *((name, ctypes.c_void_p) for name in ("wanted", "counts", "zones")),
    ]


@dataclass(frozen=True)
class Choice:
    """What an encoder of fields chooses by.

    Attributes
    ----------
    first_shaped : int
        First level whose noise is shaped.
    gain : float
        Of noise shaping.
    price : float
        Squared quantisation steps that a bit is worth; 0 rounds to the nearest.
    """

    first_shaped: int
    gain: float
    price: float


def decode_values(
    mesh: Hierarchy,
    residuals: npt.NDArray[np.int32],
    n_learned: int,
    key: Floats | None = None,
    prepared: Prepared | None = None,
) -> Floats:
    """Values of fields, of shape (V, K), in quantisation steps.

    Parameters
    ----------
    residuals : int32 array of shape (K, V)
        In coding order, as everything here.
    n_learned : int
        Modes that the weights follow.
    key : float64 array of shape (V, K of the key block), optional
        Values of the key block.
    prepared : Prepared, optional
        `prepared_weights` of this mesh, key and `n_learned`; else they are found anew.
    """
    return _run(mesh, residuals, n_learned, key, prepared, None, None)


def prepared_weights(mesh: Hierarchy, n_learned: int, key: Floats | None = None) -> Prepared:
    """What several blocks of the same key, or without any, begin with: 608 bytes a vertex."""
    found = memory(size_of("reel_predict_prepare_memory", len(mesh.order), len(mesh.smooth_starts)))
    core_mesh = _mesh(mesh)
    fields = _fields(mesh, 0, n_learned, None, None, key, found)

    def fill(part: slice) -> None:
        given = ctypes.byref(core_mesh), ctypes.byref(fields)
        call("reel_predict_prepare", *given, part.start, part.stop, what="fields")

    in_threads(fill, [part for parts in stretches(mesh, _decoded_apart()) for part in parts])
    return found


def encode_values(
    mesh: Hierarchy,
    wanted: Floats,
    choice: Choice,
    n_learned: int,
    key: Floats | None = None,
    prepared: Prepared | None = None,
) -> tuple[npt.NDArray[np.int32], Floats]:
    """Residuals of shape (K, V), and the values of shape (V, K) that they decode to.

    Parameters
    ----------
    wanted : float64 array of shape (V, K)
        Values to come near to, in quantisation steps.
    n_learned, key, prepared
        As of `decode_values`.

    Raises
    ------
    InvalidInputError
        If a residual is too large for a stream.
    """
    residuals = np.empty(wanted.shape[::-1], np.int32)
    given = np.ascontiguousarray(wanted)
    values = _run(mesh, residuals, n_learned, key, prepared, given, choice)
    return residuals, values


def _mesh(mesh: Hierarchy) -> _Mesh:
    smooth, (n_verts, stencil_size) = mesh.coming_smooth.result(), mesh.stencil.shape
    return _Mesh(
        n_verts,
        len(mesh.smooth_starts),
        stencil_size,
        _address(mesh.level_starts),
        _address(mesh.smooth_starts),
        _address(mesh.stencil),
        _address(mesh.hops),
        _address(smooth),
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


def _run(
    mesh: Hierarchy,
    residuals: npt.NDArray[np.int32],
    n_learned: int,
    key: Floats | None,
    prepared: Prepared | None,
    wanted: Floats | None,
    choice: Choice | None,
) -> Floats:
    n_modes, n_verts = residuals.shape
    values = np.empty((n_verts, n_modes))
    core_mesh = _mesh(mesh)
    fields = _fields(mesh, n_modes, n_learned, residuals, values, key, prepared)
    counts = np.zeros((n_modes, 2))

    def run(part: slice) -> Floats:
        found = counts.copy()
        given = [ctypes.byref(core_mesh), ctypes.byref(fields)]
        if choice is None:
            call("reel_predict_decode", *given, part.start, part.stop, what="fields")
            return found
        zones = np.empty(n_modes)
        chosen = _Choice(
            choice.first_shaped, choice.gain, choice.price, *map(_address, (wanted, found, zones))
        )
        given.append(ctypes.byref(chosen))
        call("reel_predict_encode", *given, part.start, part.stop, what="fields")
        return found

    for parts in stretches(mesh, _decoded_apart() if choice is None else _counted_apart):
        if len(parts) == 1:
            counts = run(parts[0])
            continue
        results = [counts] * len(parts)

        def fill(number: int, parts: list[slice] = parts, found: list[Floats] = results) -> None:
            found[number] = run(parts[number])

        in_threads(fill, range(len(parts)))
        counts = np.sum(results, axis=0)
    return values


def _address(array: npt.NDArray[Any] | None) -> int | None:
    if array is None:
        return None
    assert array.flags.c_contiguous  # else what is passed is not what it shows
    return array.ctypes.data


def stretches(mesh: Hierarchy, size_of_parts: Callable[[int], int]) -> list[list[slice]]:
    """Cut the vertices into stretches in order, whose parts do not depend on each other.

    A stretch is many small levels in one part, or one large level in parts of a size that depends
    on that of the level.
    """
    found: list[list[slice]] = [[]]
    for start, stop in pairwise(mesh.level_starts.tolist()):
        size = size_of_parts(stop - start)
        if stop - start > size:
            parts = range(start, stop, size)
            found += [[slice(part, min(part + size, stop)) for part in parts], []]
        else:
            first = found[-1][0].start if found[-1] else start
            found[-1] = [slice(first, stop)]
    return [parts for parts in found if parts]


def _counted_apart(_: int) -> int:
    """Vertices in a part of a level in which the encoder counts."""
    return CHUNK_VERTICES


def _decoded_apart() -> Callable[[int], int]:
    """Vertices in a part of a level that is only decoded, by those in it: some parts a core."""
    n_parts = 4 * n_cores()

    def size_of_parts(n_verts: int) -> int:
        size = min(max(LEAST_VERTICES, n_verts // n_parts), CHUNK_VERTICES)
        return -(-size // BATCH_VERTICES) * BATCH_VERTICES

    return size_of_parts
