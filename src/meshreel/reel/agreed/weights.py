"""Predictor weights: the value of a vertex as a weighted sum over its stencil.

Two sources, neither of which costs a bit. *Smooth fields*, made from connectivity alone, tell how
whatever is smooth on this mesh varies from a stencil to its vertex. *Known fields*, decoded before,
tell how this animation does.
"""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array
from scipy.special import ive

from meshreel.reel.agreed.hierarchy import Resolution, scattered
from meshreel.runtime.profiling import staged
from meshreel.runtime.threads import chunks, in_threads

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

N_SMOOTH_FIELDS = 16
DIFFUSION_TIME = 12.0
"""Time for which noise diffuses over the graph of a resolution to become a smooth field."""

CHEBYSHEV_DEGREE = 18
"""Terms after which those that follow are below a thousandth at this time."""

SMOOTH_RIDGE = 1e-2
KNOWN_RIDGE = 1e-4
"""Ridges, in mean squared offsets of a stencil."""

CHUNK_VERTICES = 4096
"""Vertices whose weights are found at once: many for each call, but few enough for the cache."""


@dataclass(frozen=True)
class Stencils:
    """Vertices, the stencil that predicts each, and the weights that smooth fields suggest.

    Attributes
    ----------
    predicted : integer array of shape (n,)
    stencil : integer array of shape (n, S)
        -1 where there are no more.
    penalty : float64 array of shape (n, S)
        Cost of a unit of squared weight, 1 for the nearest.
    weights : float64 array of shape (n, S)
        Rows sum to 1, or to 0 where the stencil is empty.
    """

    predicted: Integers
    stencil: Integers
    penalty: Floats
    weights: Floats

    def __getitem__(self, rows: slice) -> "Stencils":
        """Those of some of the vertices."""
        return Stencils(
            self.predicted[rows], self.stencil[rows], self.penalty[rows], self.weights[rows]
        )

    def learn(self, fields: Floats, noise: float) -> Floats:
        """Weights of shape (n, S) that reproduce known fields, and else are as smooth fields say.

        For each vertex the weights w minimise |sum_j w_j f_j - f|^2 over the fields f, plus a
        ridge times their squared distance, by penalty, to the weights that smooth fields suggest;
        they sum to 1.

        Parameters
        ----------
        fields : float64 array of shape (V, K)
        noise : float
            Variance of the noise in each field, times the strength of the ridge against it.

        References
        ----------
        S. T. Roweis, L. K. Saul, "Nonlinear dimensionality reduction by locally linear
        embedding", Science 290, 2000: the weights of its first step.
        """
        return WeightLearner(self).learn(fields, noise)


class WeightLearner:
    """Learns weights of stencils from fields that become known one group after another.

    Parameters
    ----------
    stencils : Stencils
    """

    def __init__(self, stencils: Stencils) -> None:
        self._stencils = stencils
        self._rows = chunks(len(stencils.predicted), CHUNK_VERTICES)
        self._parts = [_Neighbours(stencils[rows]) for rows in self._rows]
        self._n_fields = 0

    def copy(self) -> "WeightLearner":
        """One that knows the same fields and goes on by itself."""
        other = copy(self)
        other._parts = [part.copy() for part in self._parts]
        return other

    @staged("weights")
    def learn(self, fields: Floats, noise: float) -> Floats:
        """Weights after some more fields of shape (V, K) are known; see `Stencils.learn`."""
        known = self._stencils
        self._n_fields += fields.shape[1]
        if not (self._n_fields and known.stencil.shape[1]):
            return known.weights
        learned = np.empty_like(known.weights)
        by_field = np.ascontiguousarray(fields.T)

        def fill(number: int) -> None:
            rows, part = self._rows[number], self._parts[number]
            part.add(by_field)
            ridge = KNOWN_RIDGE * part.spread() + noise * self._n_fields
            learned[rows] = part.weights(ridge)

        in_threads(fill, range(len(self._parts)))
        return learned


class _Neighbours:
    """Some vertices and those of their stencils, and the weights that reproduce known fields.

    The last axis of the arrays goes over the vertices: one NumPy call then serves a row of them,
    and there is no call for each small matrix.
    """

    def __init__(self, stencils: Stencils) -> None:
        stencil = np.ascontiguousarray(stencils.stencil.T)
        self._predicted = stencils.predicted
        self._is_there = stencil >= 0
        self._places = np.where(self._is_there, stencil, self._predicted)  # where it ends: offset 0
        self._penalty = np.ascontiguousarray(stencils.penalty.T)
        self._suggested = np.ascontiguousarray(stencils.weights.T)
        self._gram = np.zeros((len(stencil), *stencil.shape))  # nothing below the diagonal

    def copy(self) -> "_Neighbours":
        """One that knows the same fields and goes on by itself."""
        other = copy(self)
        other._gram = self._gram.copy()
        return other

    def add(self, fields: Floats) -> None:
        """Take in some more fields, of shape (K, V)."""
        offsets = np.take(fields, self._places, axis=1)
        offsets -= np.take(fields, self._predicted, axis=1)[:, None]
        for place, gram in enumerate(self._gram):
            gram[place:] += np.einsum("kn,kjn->jn", offsets[:, place], offsets[:, place:])

    def spread(self) -> Floats:
        """Mean squared offset of each stencil, of shape (n,)."""
        n_there = np.maximum(self._is_there.sum(axis=0), 1)
        return np.asarray(np.einsum("iin->n", self._gram) / n_there)

    def weights(self, ridge: Floats) -> Floats:
        """Weights w of sum 1 that minimise w gram w + ridge penalty (w - suggested)^2.

        Those of places that are not there are 0; rows without any place are 0 throughout. The ridge
        is of shape (n,), the weights are of shape (n, S).
        """
        size, _, n_predicted = self._gram.shape
        # Where nothing varies, all weights reproduce it; any ridge then keeps the suggested ones.
        own = ridge * self._penalty
        own = np.where(own > 0, own, 1.0)
        # The matrix, with two right sides: the pull to the suggested weights, and the sum.
        system = np.empty((size, size + 2, n_predicted))
        for place, row in enumerate(system):
            row[place:size] = self._gram[place, place:]
            row[place] += own[place]
        system[:, size] = own * self._suggested
        system[:, size + 1] = self._is_there
        pivots = _eliminate(system)
        drawn, summed = system[:, size], system[:, size + 1]
        weighted = pivots * summed
        strength = np.einsum("sn,sn->n", weighted, summed)
        missing = 1.0 - np.einsum("sn,sn->n", weighted, drawn)
        drawn += missing / np.where(strength > 0, strength, 1.0) * summed
        return np.ascontiguousarray(_substitute(system, pivots).T)


def _eliminate(system: Floats) -> Floats:
    """Bring symmetric systems to triangular form in place; reciprocals of pivots, (S, n).

    Parameters
    ----------
    system : float64 array of shape (S, S + R, n)
        n positive definite matrices, of which nothing below the diagonal is read, with R right
        sides each.
    """
    pivots = np.empty((len(system), system.shape[2]))
    for place, row in enumerate(system):
        factors = system[:place, place] * pivots[:place]
        row[place:] -= np.einsum("kn,kjn->jn", factors, system[:place, place:])
        np.divide(1.0, row[place], out=pivots[place])
    return pivots


def _substitute(system: Floats, pivots: Floats) -> Floats:
    """Solutions of shape (S, n) of triangular systems of `_eliminate`, for the first right side."""
    size = len(system)
    solved = np.empty((size, system.shape[2]))
    for place in reversed(range(size)):
        row = system[place]
        later = np.einsum("kn,kn->n", row[place + 1 : size], solved[place + 1 :])
        solved[place] = pivots[place] * (row[size] - later)
    return solved


def joined_stencils(parts: Sequence[Stencils], size: int) -> Stencils:
    """The stencils of several resolutions as one, all of a size: smaller ones are filled up."""

    def filled(values: npt.NDArray[Any], filling: float) -> npt.NDArray[Any]:
        missing = size - values.shape[1]
        return np.pad(values, ((0, 0), (0, missing)), constant_values=filling)

    return Stencils(
        np.concatenate([part.predicted for part in parts]),
        np.concatenate([filled(part.stencil, -1) for part in parts]),
        np.concatenate([filled(part.penalty, 1.0) for part in parts]),
        np.concatenate([filled(part.weights, 0.0) for part in parts]),
    )


def smooth_stencils(resolution: Resolution) -> Stencils:
    """Stencils of a resolution, with the weights that best reproduce smooth fields.

    The smooth fields are noise that diffused over the graph of the resolution: exp(-t L) of random
    signs, with L = I - D^-1 C.
    """
    place_of = np.zeros(resolution.members[-1] + 1, np.int64)
    place_of[resolution.members] = np.arange(len(resolution.members))
    is_there = resolution.stencil >= 0
    predicted, stencil = (
        place_of[resolution.predicted],
        np.where(is_there, place_of[resolution.stencil], -1),
    )
    penalty = np.where(is_there, np.maximum(resolution.hops, 1) ** 2, 1e6).astype(np.float64)
    weights = np.zeros(stencil.shape)
    if stencil.shape[1]:
        fields = np.ascontiguousarray(_smooth_fields(resolution.adjacency).T)
        penalty /= penalty.min(axis=1, keepdims=True)

        local = Stencils(predicted, stencil, penalty, weights)

        def fill(rows: slice) -> None:
            part = _Neighbours(local[rows])
            part.add(fields)
            weights[rows] = part.weights(SMOOTH_RIDGE * part.spread())

        in_threads(fill, chunks(len(weights), CHUNK_VERTICES))
    return Stencils(resolution.predicted, resolution.stencil, penalty, weights)


def _smooth_fields(graph: csr_array) -> Floats:
    """Fields of shape (N, N_SMOOTH_FIELDS): exp(-t (I - W)) of signs, W the neighbours' mean."""
    n_verts = graph.shape[0]
    degrees = np.diff(graph.indptr)
    shares = np.repeat(1.0 / np.maximum(degrees, 1), degrees)
    mean = csr_array((shares, graph.indices, graph.indptr), shape=graph.shape)
    signs = scattered(np.arange(n_verts * N_SMOOTH_FIELDS)) >> np.uint64(63)
    before = 2.0 * signs.reshape(n_verts, N_SMOOTH_FIELDS).astype(np.float64) - 1.0
    # exp(-t (1 - w)) = sum_k c_k T_k(w), with c_k = (2 - [k = 0]) exp(-t) I_k(t).
    current = np.asarray(mean @ before)
    total = ive(0, DIFFUSION_TIME) * before
    twice = 2.0 * mean
    for degree in range(1, CHEBYSHEV_DEGREE + 1):
        total += 2.0 * ive(degree, DIFFUSION_TIME) * current
        following = twice @ current
        following -= before
        before, current = current, following
    return np.asarray(total)
