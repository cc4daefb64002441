"""Vertices from delta coordinates (paper Eq. 11, paper Eq. 12)."""

from collections.abc import Callable

import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.csgraph import connected_components

from meshreel.arrays import Floats, Integers
from meshreel.errors import SolverError
from meshreel.runtime.threads import fork_safe_lock

Solve = Callable[[Floats], Floats]


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
        """Solve for the values at all vertices, for all columns at once.

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

    def responses(self, vertices: Integers) -> Floats:
        """Columns of ``(L^T L + I_a^T I_a)^-1`` of these vertices, of shape (V, N).

        The column of an anchor is the solution for zero deltas and that anchor at 1.
        """
        units = np.zeros((self._laplacian.shape[0], len(vertices)))
        units[vertices, np.arange(len(vertices))] = 1.0
        return self._solver.solve(units)


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


class CholeskySolver:
    """Factor of a sparse symmetric positive definite matrix, for any number of right-hand sides.

    Uses cholespy if it is installed, else SciPy's sparse LU, which is slower.

    Parameters
    ----------
    matrix : csc_array of shape (V, V)
        Both triangles filled, float64.

    Raises
    ------
    SolverError
        If the factorization fails.
    """

    def __init__(self, matrix: csc_array) -> None:
        self._solve = _cholespy_solve(matrix) or _splu_solve(matrix)

    def solve(self, right: Floats) -> Floats:
        """Solution of shape (V, K) for right-hand sides of shape (V, K).

        Raises
        ------
        SolverError
            If it is not finite: the matrix is singular to working precision.
        """
        solution = self._solve(np.ascontiguousarray(right, np.float64))
        if not np.isfinite(solution).all():
            raise SolverError(
                "the reconstruction system is singular to working precision: its solution is not "
                "finite; more anchors make it better conditioned"
            )
        return solution


def _cholespy_solve(matrix: csc_array) -> Solve | None:
    try:
        from cholespy import CholeskySolverD, MatrixType
    except ImportError:
        return None
    size = matrix.shape[0]
    try:
        factor = CholeskySolverD(
            size,
            matrix.indptr.astype(np.int32),
            matrix.indices.astype(np.int32),
            matrix.data.astype(np.float64),
            MatrixType.CSC,
        )
    except (RuntimeError, ValueError) as error:
        raise SolverError(
            f"the reconstruction system cannot be factored ({error}); more anchors make it better "
            "conditioned"
        ) from error
    lock = fork_safe_lock()  # CHOLMOD keeps its workspace with the factor

    def solve(right: Floats) -> Floats:
        solution = np.zeros_like(right)
        with lock:
            factor.solve(right, solution)
        return solution

    return solve


def _splu_solve(matrix: csc_array) -> Solve:
    from scipy.sparse.linalg import splu

    try:
        return splu(matrix).solve
    except RuntimeError as error:
        raise SolverError(f"the reconstruction system cannot be factored: {error}") from error
