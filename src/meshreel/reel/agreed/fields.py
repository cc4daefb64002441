"""The method `reel`: mode fields, predicted over the mesh by weights learned from earlier ones.

A mode is one field on the mesh with a time vector for each axis. Fields are coded in groups, and
each group over the levels of a hierarchy of the vertices, in closed loop. What foretells a vertex
from its stencil is learned from the groups decoded before; what foretells the first group, from
connectivity. A decoded group is smoothed by filters whose taps are sent.

Encoder and decoder run the same `reconstruct_fields` and `reconstruct_times`; they differ only in
where the integers come from.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

from meshreel.geometry.laplacian import reproducing_laplacian
from meshreel.reel.agreed.closed_loop import Predictor, StepsOf, reconstruct_levels
from meshreel.reel.agreed.field_mesh import FieldMesh
from meshreel.reel.agreed.prediction import WeightLearner
from meshreel.reel.agreed.timeline import time_predictors
from meshreel.runtime.profiling import staged

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

NOISE_OF_WEIGHTS = 1.0 / 12.0
NOISE_OF_FILTERS = 8.0 / 12.0
"""Ridges of learned weights in squared steps; rounding has a variance of 1/12."""

N_FILTER_FIELDS = 6
"""Fields, the first ones, that the weights of filters are learned from: more change little."""

N_TAPS = 2
TAP_STEP = 1.0 / 16.0
MAX_TAP = 127


@dataclass(frozen=True)
class Layout:
    """What the decoder has to know of how a block was made.

    Attributes
    ----------
    step : float32
        Of the fields.
    group_ends : tuple of int
        Number of the mode behind each group; ascending, the last is K.
    stencil_size : int
        Vertices that foretell one.
    reference : int
        How many blocks before this one its key block is, from whose fields its first weights are
        learned; 0: it has none, and can be a key block itself.
    """

    step: np.float32
    group_ends: tuple[int, ...]
    stencil_size: int
    reference: int = 0

    @property
    def groups(self) -> list[slice]:
        """The modes of each group."""
        return [slice(start, end) for start, end in pairwise((0, *self.group_ends))]


@dataclass(frozen=True)
class FieldBlock:
    """A block of frames as integers.

    Attributes
    ----------
    layout : Layout
    times : int64 array of shape (T, 3 K)
        Steps of the time vectors; x, y and z of mode 1, of mode 2, ...
    fields : int64 array of shape (K, V)
        Steps of the fields.
    taps : int64 array of shape (K, N_TAPS)
        Of the filter of each field, in TAP_STEP.
    """

    layout: Layout
    times: Integers
    fields: Integers
    taps: Integers

    @property
    def n_modes(self) -> int:
        """K."""
        return int(self.fields.shape[0])


class KeyFields:
    """Fields of a key block, and what they tell the blocks that refer to it.

    Parameters
    ----------
    mesh : FieldMesh
    fields : float64 array of shape (V, K)
        In steps of the block, which are comparable between blocks of any length.
    """

    def __init__(self, mesh: FieldMesh, fields: Floats) -> None:
        self._mesh = mesh
        self._fields = fields

    @cached_property
    def _learned(self) -> tuple[WeightLearner, list[Predictor]]:
        learner = WeightLearner(self._mesh.stencils)
        return learner, self._mesh.predictors(learner.learn(self._fields, NOISE_OF_WEIGHTS))

    @property
    def predictors(self) -> list[Predictor]:
        """Of the first modes of a block that refers to this one."""
        return self._learned[1]

    def learner(self) -> WeightLearner:
        """One that knows these fields."""
        return self._learned[0].copy()


def key_fields(layout: Layout, mesh: FieldMesh, fields: Floats) -> KeyFields:
    """Decoded fields of a block, of shape (1, K, V), for those that refer to it."""
    return KeyFields(mesh, fields[0].T / float(layout.step))


@staged("fields")
def reconstruct_fields(
    mesh: FieldMesh,
    layout: Layout,
    steps_of: Callable[[slice, Sequence[Predictor]], StepsOf],
    taps_of: Callable[[slice, Floats, Floats], Integers] | None,
    key: KeyFields | None = None,
) -> Floats:
    """Decoded fields of shape (V, K).

    Parameters
    ----------
    mesh : FieldMesh
    layout : Layout
    steps_of : callable
        Gives what reads or chooses the integers of a group of modes with these predictors.
    taps_of : callable or None
        Gives the taps of a group, of shape (k, N_TAPS), for its fields of shape (V, k) and their
        differences of shape (N_TAPS, V, k). None: nothing is filtered.
    key : KeyFields, optional
        Of the block that this one refers to.
    """
    n_verts, step = mesh.n_verts, float(layout.step)
    known = latest = np.zeros((n_verts, 0))
    learner: WeightLearner | None = None
    for number, modes in enumerate(layout.groups):
        if key is not None and number == 0:
            predictors = key.predictors
        else:
            if learner is None:
                learner = WeightLearner(mesh.stencils) if key is None else key.learner()
            predictors = mesh.predictors(learner.learn(latest / step, NOISE_OF_WEIGHTS))
        n_columns = modes.stop - modes.start
        values = reconstruct_levels(
            predictors, n_verts, n_columns, step, steps_of(modes, predictors)
        )
        latest = values
        if taps_of is not None:
            if known.shape[1] < N_FILTER_FIELDS:
                telling = np.hstack([known, values])[:, :N_FILTER_FIELDS]
                noise = NOISE_OF_FILTERS * step**2
                laplacian = reproducing_laplacian(mesh.adjacency, telling, noise)
            differences = _repeated(laplacian, values)
            taps = TAP_STEP * taps_of(modes, values, differences)
            latest = values + np.einsum("kt,tvk->vk", taps, differences)
        known = np.hstack([known, latest])
    return known


@staged("time vectors")
def reconstruct_times(n_frames: int, n_modes: int, steps_of: StepsOf) -> Floats:
    """Decoded time vectors of shape (3 T, K), each of length 1 (or 0)."""
    decoded = reconstruct_levels(time_predictors(n_frames), n_frames, 3 * n_modes, 1.0, steps_of)
    vectors = decoded.reshape(n_frames, n_modes, 3).transpose(2, 0, 1).reshape(-1, n_modes)
    lengths = np.linalg.norm(vectors, axis=0)
    return np.asarray(vectors / np.where(lengths > 0, lengths, 1.0))


def synthesise_fields(
    block: FieldBlock, mesh: FieldMesh, key: KeyFields | None = None
) -> tuple[Floats, Floats]:
    """Basis of shape (3, T, K) and fields of shape (1, K, V): frames are their product.

    The key is of the block that this one refers to, if it does.
    """
    n_frames = len(block.times)
    vectors = reconstruct_times(
        n_frames, block.n_modes, reading(time_predictors(n_frames), block.times)
    )

    def steps_of(modes: slice, _: Sequence[Predictor]) -> StepsOf:
        return lambda level, _: block.fields[modes, mesh.levels[level]].T

    def taps_of(modes: slice, *_: Floats) -> Integers:
        return block.taps[modes]

    # Taps of 0 change nothing, so that their differences are not worth their time.
    taken = taps_of if block.taps.any() else None
    fields = reconstruct_fields(mesh, block.layout, steps_of, taken, key)
    return vectors.reshape(3, n_frames, block.n_modes), fields.T[None]


def group_ends(n_modes: int, ends: Sequence[int]) -> tuple[int, ...]:
    """Ends of the groups of K modes, for the ends of all groups but the last."""
    return (*(end for end in ends if end < n_modes), n_modes)


def reading(predictors: Sequence[Predictor], integers: Integers) -> StepsOf:
    """What gives the integers of an array, row by row."""
    return lambda level, _: integers[predictors[level].rows]


def _repeated(laplacian: csr_array, values: Floats) -> Floats:
    """The Laplacian applied once, twice, ...: of shape (N_TAPS, V, k)."""
    differences = [values]
    for _ in range(N_TAPS):
        differences.append(np.asarray(laplacian @ differences[-1]))
    return np.stack(differences[1:])
