"""Vertices from delta coordinates (paper Eq. 11, paper Eq. 12)."""

import math

import numpy as np
from scipy.sparse import block_array, csr_array, diags_array, eye_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from meshreel.arrays import Floats, Integers
from meshreel.errors import SolverError

MAX_ROW_ENTRIES = 100
"""Rows of the Laplacian with more entries are not squared: their squares would be dense."""


def factor_bytes(n_verts: int) -> int:
    """Memory of a factored system, fitted to triangulated grids of up to 160,000 vertices."""
    return round(200 * n_verts * math.log2(n_verts + 1))


class ReconstructionSystem:
    """The least-squares system ``[L; I_a] x = [delta; a]`` (paper Eq. 12), factored once.

    With one anchor in each connected component it is paper Eq. 11, L alone: the least-squares
    solution of the singular L is unique up to a translation of each component, which a single
    anchor fixes without adding to the residual.

    Parameters
    ----------
    laplacian : csr_array of shape (V, V)
    anchors : integer array of shape (A,)
        Distinct vertices, at least one in each connected component of the Laplacian.

    Raises
    ------
    SolverError
        If a component has no anchor, which leaves its translation undetermined, or if the
        factorization fails.
    """

    def __init__(self, laplacian: csr_array, anchors: Integers) -> None:
        _check_anchored(laplacian, anchors)
        self._laplacian = laplacian
        self._anchors = anchors
        selected = np.zeros(laplacian.shape[0])
        selected[anchors] = 1.0
        is_long = np.diff(laplacian.indptr) > MAX_ROW_ENTRIES
        short, long = laplacian[~is_long], laplacian[is_long]
        matrix = short.T @ short + diags_array(selected)
        if is_long.any():  # y = B x for the long rows B: eliminating y adds B^T B
            matrix = block_array([[matrix, long.T], [long, -eye_array(long.shape[0])]])
        try:
            self._factor = splu(
                matrix.tocsc(),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.01,
                options={"SymmetricMode": True},
            )
        except RuntimeError as error:
            raise SolverError(
                f"the reconstruction system cannot be factored ({error}); more anchors make it "
                "better conditioned"
            ) from error

    def solve(self, deltas: Floats, anchor_values: Floats) -> Floats:
        """Solve for the values at all vertices, for all columns at once.

        Parameters
        ----------
        deltas : float64 array of shape (V, K)
        anchor_values : float64 array of shape (A, K)
            In the order of the anchors.

        Returns
        -------
        float64 array of shape (V, K)

        Raises
        ------
        SolverError
            If it is not finite: the matrix is singular to working precision.
        """
        rhs = np.asarray(self._laplacian.T @ deltas)
        rhs[self._anchors] += anchor_values
        return self._solve(rhs)

    def responses(self, vertices: Integers) -> Floats:
        """Columns of ``(L^T L + I_a^T I_a)^-1`` of these vertices, of shape (V, N).

        The column of an anchor is the solution for zero deltas and that anchor at 1.
        """
        units = np.zeros((self._laplacian.shape[0], len(vertices)))
        units[vertices, np.arange(len(vertices))] = 1.0
        return self._solve(units)

    def _solve(self, rhs: Floats) -> Floats:
        n_verts, n_unknowns = len(rhs), self._factor.shape[0]
        padded = np.zeros((n_unknowns, rhs.shape[1]))
        padded[:n_verts] = rhs
        solution = self._factor.solve(padded)[:n_verts]
        if not np.isfinite(solution).all():
            raise SolverError(
                "the reconstruction system is singular to working precision: its solution is not "
                "finite; more anchors make it better conditioned"
            )
        return solution


def _check_anchored(laplacian: csr_array, anchors: Integers) -> None:
    n_components, labels = connected_components(laplacian, directed=False)
    has_anchor = np.zeros(n_components, bool)
    has_anchor[labels[anchors]] = True
    if not has_anchor.all():
        missing = np.flatnonzero(~has_anchor)
        sizes = np.bincount(labels, minlength=n_components)[missing]
        raise SolverError(
            f"the system [L; I_a] is singular: {len(missing)} of {n_components} connected "
            f"components have no anchor (the first of them has {sizes[0]} vertices), so their "
            "translation is undetermined; give every component at least one anchor"
        )
