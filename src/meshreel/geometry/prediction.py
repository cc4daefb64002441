"""Weights that foretell a vertex's value from those of its stencil.

Two sources, neither of which costs a bit. *Smooth fields*, made from connectivity alone, tell how
whatever is smooth on this mesh varies from a stencil to its vertex. *Known fields*, decoded before,
tell how this animation does.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array
from scipy.special import ive

from meshreel.geometry.hierarchy import Scale, scattered
from meshreel.profiling import staged
from meshreel.threads import chunks, in_threads

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

N_SMOOTH_FIELDS = 16
DIFFUSION_TIME = 12.0
"""Time for which noise diffuses over the graph of a scale to become a smooth field."""

CHEBYSHEV_DEGREE = 18
"""Terms after which those that follow are below a thousandth at this time."""

SMOOTH_RIDGE = 1e-2
KNOWN_RIDGE = 1e-4
"""Ridges, in mean squared offsets of a stencil."""

CHUNK_VERTICES = 1024
"""Vertices whose weights are found at once: their matrices should stay in the cache."""


@dataclass(frozen=True)
class Stencils:
    """Vertices, those that foretell each, and the weights that smooth fields suggest.

    Attributes
    ----------
    targets : integer array of shape (n,)
    stencil : integer array of shape (n, S)
        -1 where there are no more.
    penalty : float64 array of shape (n, S)
        What a unit of squared weight costs, 1 for the nearest.
    weights : float64 array of shape (n, S)
        Rows sum to 1, or to 0 where the stencil is empty.
    """

    targets: Integers
    stencil: Integers
    penalty: Floats
    weights: Floats

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
        n_targets, size = stencils.stencil.shape
        self._stencils = stencils
        self._is_there = stencils.stencil >= 0
        self._gram = np.zeros((n_targets, size, size))
        self._n_fields = 0

    @staged("weights")
    def learn(self, fields: Floats, noise: float) -> Floats:
        """Weights after some more fields of shape (V, K) are known; see `Stencils.learn`."""
        known = self._stencils
        self._n_fields += fields.shape[1]
        if not (self._n_fields and known.stencil.shape[1]):
            return known.weights
        learned = np.empty_like(known.weights)

        def fill(rows: slice) -> None:
            offsets = _offsets(fields, known.targets[rows], known.stencil[rows])
            gram, is_there = self._gram[rows], self._is_there[rows]
            gram += offsets @ np.swapaxes(offsets, 1, 2)
            ridge = KNOWN_RIDGE * _spread(gram, is_there) + noise * self._n_fields
            penalty = ridge[:, None] * known.penalty[rows]
            learned[rows] = _nearest_weights(gram, penalty, known.weights[rows], is_there)

        in_threads(fill, chunks(len(learned), CHUNK_VERTICES))
        return learned


def joined_stencils(parts: Sequence[Stencils], size: int) -> Stencils:
    """The stencils of several scales as one, all of a size: smaller ones are filled up."""

    def filled(values: npt.NDArray[Any], filling: float) -> npt.NDArray[Any]:
        missing = size - values.shape[1]
        return np.pad(values, ((0, 0), (0, missing)), constant_values=filling)

    return Stencils(
        np.concatenate([part.targets for part in parts]),
        np.concatenate([filled(part.stencil, -1) for part in parts]),
        np.concatenate([filled(part.penalty, 1.0) for part in parts]),
        np.concatenate([filled(part.weights, 0.0) for part in parts]),
    )


def smooth_stencils(scale: Scale) -> Stencils:
    """Stencils of a scale, with the weights that best reproduce smooth fields.

    The smooth fields are noise that diffused over the graph of the scale: exp(-t L) of random
    signs, with L = I - D^-1 C.
    """
    targets = np.searchsorted(scale.members, scale.targets)
    is_there = scale.stencil >= 0
    stencil = np.where(is_there, np.searchsorted(scale.members, scale.stencil), -1)
    penalty = np.where(is_there, np.maximum(scale.hops, 1) ** 2, 1e6).astype(np.float64)
    weights = np.zeros(stencil.shape)
    if stencil.shape[1]:
        fields = _smooth_fields(scale.adjacency)
        penalty /= penalty.min(axis=1, keepdims=True)

        def fill(rows: slice) -> None:
            offsets = _offsets(fields, targets[rows], stencil[rows])
            gram = offsets @ np.swapaxes(offsets, 1, 2)
            ridge = SMOOTH_RIDGE * _spread(gram, is_there[rows])
            weights[rows] = _nearest_weights(
                gram, ridge[:, None] * penalty[rows], weights[rows], is_there[rows]
            )

        in_threads(fill, chunks(len(weights), CHUNK_VERTICES))
    return Stencils(scale.targets, scale.stencil, penalty, weights)


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
    for degree in range(1, CHEBYSHEV_DEGREE + 1):
        total += 2.0 * ive(degree, DIFFUSION_TIME) * current
        before, current = current, 2.0 * (mean @ current) - before
    return np.asarray(total)


def _offsets(fields: Floats, targets: Integers, stencil: Integers) -> Floats:
    """What a stencil's values differ by from the vertex's: of shape (n, S, K); 0 where it ends."""
    own = targets[:, None]
    return np.asarray(fields[np.where(stencil >= 0, stencil, own)] - fields[own])


def _spread(gram: Floats, is_there: npt.NDArray[np.bool_]) -> Floats:
    """Mean squared offset of each stencil, of shape (n,)."""
    n_there = np.maximum(is_there.sum(axis=1), 1)
    return np.asarray(np.trace(gram, axis1=1, axis2=2) / n_there)


def _nearest_weights(
    gram: Floats, ridge: Floats, suggested: Floats, is_there: npt.NDArray[np.bool_]
) -> Floats:
    """Weights of sum 1 that minimise w gram w + ridge (w - suggested)^2, row by row.

    Those of places that are not there are 0; rows without any place are 0 throughout.
    """
    # Where nothing varies, every choice reproduces it; any ridge then keeps what is suggested.
    ridge = np.where(ridge > 0, ridge, 1.0)
    gram = gram.copy()
    places = np.arange(gram.shape[1])
    gram[:, places, places] += ridge
    solved = np.linalg.solve(gram, np.stack([ridge * suggested, is_there], axis=2))
    sums = solved.sum(axis=1)
    missing = (1.0 - sums[:, 0]) / np.where(sums[:, 1] > 0, sums[:, 1], 1.0)
    return np.asarray(solved[:, :, 0] + missing[:, None] * solved[:, :, 1])
