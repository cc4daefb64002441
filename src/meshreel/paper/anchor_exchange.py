"""Exchange of anchors for vertices that leave a smaller error in the decoded positions."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from meshreel.arrays import Floats, Integers
from meshreel.errors import InvalidInputError
from meshreel.model.geometry.connectivity import component_labels
from meshreel.paper.anchors import farthest_points
from meshreel.paper.laplacian import adjacency_matrix
from meshreel.paper.mesh_model import MeshModel
from meshreel.paper.pipeline import MAX_RESPONSES

CANDIDATES_PER_ANCHOR = 10

MAX_PASSES = 3
"""Passes over all anchors; most exchanges happen in the first."""

MIN_REDUCTION = 1e-3
"""Smallest reduction of the squared error by one exchange, in squared errors per anchor."""

N_ALTERNATIVES = 5
"""Candidates that are tried instead of the only anchor of a component."""


def exchange_anchors(mesh: MeshModel, delta_errors: Iterable[Floats]) -> Integers:
    """Return anchors with which deltas of these errors decode to smaller position errors.

    With exact anchors S, deltas ``L x + n`` decode to ``x + e`` with ``(L^T L + S^T S) e = L^T n``
    (Eq. 12). Each anchor in turn is exchanged for the candidate with the smallest squared
    error, if that is smaller than before. Adding or removing an anchor changes the inverse of the
    matrix by a rank of one, so that the error of every exchange is computed without another
    factorization.

    Candidates are farthest points, 10 for each anchor, or fewer if responses of all vertices to
    them exceed `pipeline.MAX_RESPONSES`. Every component keeps an anchor.

    Parameters
    ----------
    mesh : MeshModel
        With the initial anchors.
    delta_errors : iterable of float64 arrays of shape (V, N)
        Errors n of the deltas, in any number of columns.

    Returns
    -------
    int64 array of shape (A,), ascending

    Raises
    ------
    InvalidInputError
        If the responses to the anchors alone are too many; the message says how many anchors fit.

    References
    ----------
    R. D. Cook, C. J. Nachtsheim, "A comparison of algorithms for constructing exact D-optimal
    designs", Technometrics 22(3), 1980: the modified algorithm of Fedorov. The criterion here is
    the error itself.
    """
    candidates = _candidates(mesh)
    state = _initial_state(mesh, candidates, delta_errors)
    labels = component_labels(mesh.faces, mesh.n_verts)
    components, is_anchor = labels[candidates], np.isin(candidates, mesh.anchors)
    for _ in range(MAX_PASSES):
        before = is_anchor.copy()
        for anchor in np.argsort(-state.reductions(-1), kind="stable"):
            if not is_anchor[anchor]:
                continue
            others = components[is_anchor] == components[anchor]
            replaced = (
                _replace(state, is_anchor, anchor)
                if others.sum() > 1
                else _replace_within(state, is_anchor, anchor, components == components[anchor])
            )
            if replaced is not None:
                state, candidate = replaced
                is_anchor[[anchor, candidate]] = False, True
        if np.array_equal(is_anchor, before):
            break
    return np.sort(candidates[is_anchor])


@dataclass(frozen=True)
class _State:
    """Errors at C candidates, and how they respond to anchors there."""

    responses: Floats
    """float64 array of shape (C, C). Rows and columns of ``R = (L^T L + S^T S)^-1`` at the
    candidates.
    """
    products: Floats
    """float64 array of shape (C, C). Inner products of the columns of R over all vertices."""
    errors: Floats
    """float64 array of shape (C, N). The errors e at the candidates."""
    correlations: Floats
    """float64 array of shape (C, N). Inner products of the columns of R with those of e over all
    vertices.
    """
    squared_error: float
    """Over all vertices and columns."""

    def reductions(self, sign: int) -> Floats:
        """Reduction of the squared error by an anchor at each candidate, or by its removal.

        Parameters
        ----------
        sign : int
            1 adds an anchor, -1 removes it.
        """
        scale = 1 + sign * np.diag(self.responses)
        # Without its only anchor a component is not determined.
        safe = np.where(scale > np.finfo(float).eps ** 0.5, scale, np.inf)
        energies = np.einsum("cn,cn->c", self.errors, self.errors)
        mixed = np.einsum("cn,cn->c", self.errors, self.correlations)
        return np.asarray(2 * sign * mixed / safe - energies * np.diag(self.products) / safe**2)

    def changed(self, candidate: int, sign: int) -> "_State":
        """The state after adding or removing an anchor (Sherman-Morrison formula)."""
        response, product = self.responses[candidate], self.products[candidate]
        scale = 1 + sign * response[candidate]
        factors = sign * self.errors[candidate] / scale
        half = sign * product / scale - product[candidate] * response / (2 * scale**2)
        correlations = self.correlations - np.outer(product, factors)
        correlations -= np.outer(response, sign * correlations[candidate] / scale)
        return _State(
            self.responses - np.outer(response, sign * response / scale),
            self.products - np.stack([half, response]).T @ np.stack([response, half]),
            self.errors - np.outer(response, factors),
            correlations,
            self.squared_error - float(self.reductions(sign)[candidate]),
        )

    def is_better_than(self, other: "_State", n_anchors: int) -> bool:
        """Whether the squared error is smaller by more than the threshold."""
        threshold = MIN_REDUCTION * other.squared_error / n_anchors
        return self.squared_error < other.squared_error - threshold


def _candidates(mesh: MeshModel) -> Integers:
    """Vertices that may become anchors, among them all anchors."""
    n_anchors = len(mesh.anchors)
    connected = np.setdiff1d(np.arange(mesh.n_verts), mesh.isolated, assume_unique=True)
    possible = min(MAX_RESPONSES // mesh.n_verts, len(connected))
    if possible < n_anchors:
        raise InvalidInputError(
            f"anchor_set=optimized can exchange at most {possible} anchors of {mesh.n_verts} "
            f"vertices; got {n_anchors}. Use fewer anchors, or anchor_set=farthest"
        )
    adjacency = adjacency_matrix(mesh.faces, mesh.n_verts)[connected][:, connected]
    n_points = min(CANDIDATES_PER_ANCHOR * n_anchors, possible)
    points = connected[farthest_points(csr_array(adjacency), n_points)]
    others = np.setdiff1d(points, mesh.anchors)[: n_points - n_anchors]
    return np.union1d(mesh.anchors, others)


def _initial_state(mesh: MeshModel, candidates: Integers, delta_errors: Iterable[Floats]) -> _State:
    columns = mesh.responses(candidates)
    errors, correlations, squared_error = [], [], 0.0
    for some in delta_errors:
        decoded = mesh.reconstruct(some, np.zeros((len(mesh.anchors), some.shape[1])))
        errors.append(decoded[candidates])
        correlations.append(columns.T @ decoded)
        squared_error += float(np.vdot(decoded, decoded))
    return _State(
        columns[candidates],
        columns.T @ columns,
        np.concatenate(errors, axis=1),
        np.concatenate(correlations, axis=1),
        squared_error,
    )


def _replace(state: _State, is_anchor: np.ndarray, anchor: int) -> tuple[_State, int] | None:
    """Return the state with the best candidate instead of an anchor, and it; None if worse."""
    without = state.changed(anchor, -1)
    candidate = int(np.argmax(np.where(is_anchor, -np.inf, without.reductions(1))))
    replaced = without.changed(candidate, 1)
    return (replaced, candidate) if replaced.is_better_than(state, is_anchor.sum()) else None


def _replace_within(
    state: _State, is_anchor: np.ndarray, anchor: int, component: np.ndarray
) -> tuple[_State, int] | None:
    """As `_replace` for the only anchor of a component: the candidate is added first."""
    allowed = component & ~is_anchor
    order = np.argsort(np.where(allowed, -state.reductions(1), np.inf), kind="stable")
    best = None
    for candidate in order[: min(N_ALTERNATIVES, int(allowed.sum()))]:
        replaced = state.changed(candidate, 1).changed(anchor, -1)
        if replaced.is_better_than(state if best is None else best[0], is_anchor.sum()):
            best = replaced, int(candidate)
    return best
