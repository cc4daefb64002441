"""Vertices from delta coordinates (paper Eq. 11, paper Eq. 12)."""

import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.csgraph import connected_components

from meshreel.arrays import Floats, Integers
from meshreel.errors import SolverError
from meshreel.paper.reconstruction.solver import CholeskySolver


class ReconstructionSystem:
    """The least-squares system ``[L; I_a] x = [delta; a]`` (paper Eq. 12), factored once.

    With one anchor in each connected component it is paper Eq. 11, L alone: L is singular, its
    least-squares solution is unique up to a translation of each component, and a single anchor
    fixes that translation without adding to the residual.

    Parameters
    ----------
    laplacian : csr_array of shape (V, V)
    anchors : integer array of shape (A,)
        Distinct vertices, at least one in each connected component of the Laplacian.

    Raises
    ------
    SolverError
        If a component has no anchor, which leaves its translation undetermined.
    """

    def __init__(self, laplacian: csr_array, anchors: Integers) -> None:
        _check_anchored(laplacian, anchors)
        self._laplacian = laplacian
        self._anchors = anchors
        selected = np.zeros(laplacian.shape[0])
        selected[anchors] = 1.0
        matrix = csc_array(laplacian.T @ laplacian + diags_array(selected))
        self._solver = CholeskySolver(matrix)

    def solve(self, deltas: Floats, anchor_values: Floats) -> Floats:
        """Values at all vertices, for every column at once.

        Parameters
        ----------
        deltas : float64 array of shape (V, K)
        anchor_values : float64 array of shape (A, K)
            In the order of the anchors.

        Returns
        -------
        float64 array of shape (V, K)
        """
        right = np.asarray(self._laplacian.T @ deltas)
        right[self._anchors] += anchor_values
        return self._solver.solve(right)


def _check_anchored(laplacian: csr_array, anchors: Integers) -> None:
    n_components, labels = connected_components(laplacian, directed=False)
    anchored = np.zeros(n_components, bool)
    anchored[labels[anchors]] = True
    if not anchored.all():
        missing = np.flatnonzero(~anchored)
        sizes = np.bincount(labels, minlength=n_components)[missing]
        raise SolverError(
            f"the system [L; I_a] is singular: {len(missing)} of {n_components} connected "
            f"components have no anchor (the first of them has {sizes[0]} vertices), so their "
            "translation is undetermined; give every component at least one anchor"
        )
