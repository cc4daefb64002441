"""Predictor weights: the value of a vertex as a weighted sum over its stencil.

Two sources, neither of which costs a bit. *Smooth fields*, which the core makes from connectivity
alone, tell how whatever is smooth on this mesh varies from a stencil to its vertex. *Known fields*,
decoded before, tell how this animation does.
"""

from copy import copy
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.runtime.profiling import staged
from meshreel.runtime.threads import chunks, in_threads

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

KNOWN_RIDGE = 1e-4
"""Ridge, in mean squared offsets of a stencil."""

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


def penalties(stencil: npt.NDArray[np.integer], hops: npt.NDArray[np.integer]) -> Floats:
    """Cost of a unit of squared weight of stencils that reach so many edges, of shape (n, S)."""
    cost = np.where(stencil >= 0, np.maximum(hops, 1).astype(np.float64) ** 2, 1e6)
    return np.asarray(cost / cost.min(axis=1, keepdims=True))
