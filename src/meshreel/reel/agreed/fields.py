"""The method `reel`: mode fields, predicted over the mesh by weights learned from earlier ones.

A mode is one field on the mesh with a basis vector over time for each axis. Fields are coded in
groups, and each group over the levels of a hierarchy of the vertices, in closed loop. The predictor
weights of a group are learned from the groups decoded before; those of the first group, from
connectivity. A decoded group is smoothed by filters whose taps are sent.

Encoder and decoder drive the same `FieldLoop` and `ClosedLoop`; they differ only in where the
residuals come from.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

from meshreel.geometry.laplacian import reproducing_laplacian
from meshreel.reel.agreed.closed_loop import ClosedLoop, Predictor
from meshreel.reel.agreed.mesh import FieldMesh
from meshreel.reel.agreed.timeline import time_predictors
from meshreel.reel.agreed.weights import WeightLearner
from meshreel.runtime.profiling import staged

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

NOISE_OF_WEIGHTS = 1.0 / 12.0
NOISE_OF_FILTERS = 8.0 / 12.0
"""Ridges of learned weights in squared quantisation steps; rounding has a variance of 1/12."""

N_FILTER_FIELDS = 6
"""Fields, the first ones, that the weights of filters are learned from: more change little."""

N_TAPS = 2
TAP_STEP = 1.0 / 16.0
MAX_TAP = 127


@dataclass(frozen=True)
class Layout:
    """Parameters of a block that the decoder has to know.

    Attributes
    ----------
    step : float32
        Of the fields.
    group_ends : tuple of int
        Number of the mode behind each group; ascending, the last is K.
    stencil_size : int
        Vertices that predict one.
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
    basis : int64 array of shape (T, 3 K)
        Residuals of the temporal basis; x, y and z of mode 1, of mode 2, ...
    fields : int64 array of shape (K, V)
        Residuals of the fields.
    taps : int64 array of shape (K, N_TAPS)
        Of the filter of each field, in TAP_STEP.
    """

    layout: Layout
    basis: Integers
    fields: Integers
    taps: Integers

    @property
    def n_modes(self) -> int:
        """K."""
        return int(self.fields.shape[0])


class KeyFields:
    """Fields of a key block, and the predictor weights learned from them.

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
        """A learner that knows these fields."""
        return self._learned[0].copy()


def key_fields(layout: Layout, mesh: FieldMesh, fields: Floats) -> KeyFields:
    """Decoded fields of a block, of shape (1, K, V), for those that refer to it."""
    return KeyFields(mesh, fields[0].T / float(layout.step))


class FieldLoop:
    """Fields decoded group after group, each predicted by weights learned from those before.

    Both sides go through the groups in order: `learn` gives the closed loop over the levels of a
    group, whose residuals one side chooses and the other reads; `finish` ends the group.

    Parameters
    ----------
    mesh : FieldMesh
    layout : Layout
    key : KeyFields, optional
        Of the block that this one refers to.

    Attributes
    ----------
    fields : float64 array of shape (V, k)
        Of the groups that are finished.
    """

    def __init__(self, mesh: FieldMesh, layout: Layout, key: KeyFields | None = None) -> None:
        self.fields = np.zeros((mesh.n_verts, 0))
        self._mesh = mesh
        self._step = float(layout.step)
        self._key = key
        self._learner: WeightLearner | None = None
        self._latest = self.fields
        self._laplacian: csr_array | None = None
        self._differences: Floats | None = None

    def learn(self, group: slice) -> ClosedLoop:
        """The closed loop over the levels of a group of modes.

        The weights that predict it are learned from the groups before, and from the key block.
        """
        n_columns = group.stop - group.start
        predictors = self._predictors()
        self._loop = ClosedLoop(predictors, self._mesh.n_verts, n_columns, self._step)
        self._differences = None
        return self._loop

    def _predictors(self) -> list[Predictor]:
        if self._key is not None and not self.fields.shape[1]:
            return self._key.predictors
        if self._learner is None:
            key, stencils = self._key, self._mesh.stencils
            self._learner = WeightLearner(stencils) if key is None else key.learner()
        weights = self._learner.learn(self._latest / self._step, NOISE_OF_WEIGHTS)
        return self._mesh.predictors(weights)

    def differences(self) -> Floats:
        """Differences of the group that its filter adds, of shape (N_TAPS, V, k).

        They come from a Laplacian that is learned from the first fields.
        """
        if self._differences is not None:
            return self._differences
        values = self._loop.values
        if self.fields.shape[1] < N_FILTER_FIELDS:
            first = np.hstack([self.fields, values])[:, :N_FILTER_FIELDS]
            noise = NOISE_OF_FILTERS * self._step**2
            self._laplacian = reproducing_laplacian(self._mesh.adjacency, first, noise)
        assert self._laplacian is not None  # the first group has fewer fields
        self._differences = _repeated(self._laplacian, values)
        return self._differences

    def finish(self, taps: Integers | None = None) -> None:
        """End a group; where it is filtered, with taps of shape (k, N_TAPS)."""
        self._latest = self._loop.values
        if taps is not None:
            filtered = np.einsum("kt,tvk->vk", TAP_STEP * taps, self.differences())
            self._latest = self._latest + filtered
        self.fields = np.hstack([self.fields, self._latest])


@staged("fields")
def decode_fields(block: FieldBlock, mesh: FieldMesh, key: KeyFields | None = None) -> Floats:
    """Decoded fields of shape (V, K); the key is of the block that this one refers to."""
    loop = FieldLoop(mesh, block.layout, key)
    # Taps of 0 change nothing, so that their differences are not worth their time.
    is_filtered = bool(block.taps.any())
    for group in block.layout.groups:
        fields = block.fields[group].T
        loop.learn(group).decode([fields[level] for level in mesh.levels])
        loop.finish(block.taps[group] if is_filtered else None)
    return loop.fields


@staged("temporal basis")
def decode_basis(residuals: Integers) -> Floats:
    """Temporal basis of shape (3 T, K), each vector of length 1 (or 0), for residuals (T, 3 K)."""
    n_frames = len(residuals)
    predictors = time_predictors(n_frames)
    loop = ClosedLoop(predictors, n_frames, residuals.shape[1], 1.0)
    return unit_vectors(loop.decode([residuals[predictor.rows] for predictor in predictors]))


def unit_vectors(values: Floats) -> Floats:
    """Vectors of shape (3 T, K) and length 1 (or 0), for values of shape (T, 3 K)."""
    n_frames, n_modes = len(values), values.shape[1] // 3
    vectors = values.reshape(n_frames, n_modes, 3).transpose(2, 0, 1).reshape(-1, n_modes)
    lengths = np.linalg.norm(vectors, axis=0)
    return np.asarray(vectors / np.where(lengths > 0, lengths, 1.0))


def synthesise_fields(
    block: FieldBlock, mesh: FieldMesh, key: KeyFields | None = None
) -> tuple[Floats, Floats]:
    """Basis of shape (3, T, K) and fields of shape (1, K, V): frames are their product.

    The key is of the block that this one refers to, if it does.
    """
    basis = decode_basis(block.basis)
    fields = decode_fields(block, mesh, key)
    return basis.reshape(3, -1, block.n_modes), fields.T[None]


def group_ends(n_modes: int, ends: Sequence[int]) -> tuple[int, ...]:
    """Ends of the groups of K modes, for the ends of all groups but the last."""
    return (*(end for end in ends if end < n_modes), n_modes)


def _repeated(laplacian: csr_array, values: Floats) -> Floats:
    """The Laplacian applied once, twice, ...: of shape (N_TAPS, V, k)."""
    differences = [values]
    for _ in range(N_TAPS):
        differences.append(np.asarray(laplacian @ differences[-1]))
    return np.stack(differences[1:])
