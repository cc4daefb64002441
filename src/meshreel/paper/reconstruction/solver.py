"""Solver of sparse symmetric positive definite systems: factor once, solve many."""

from collections.abc import Callable

import numpy as np
from scipy.sparse import csc_array

from meshreel.arrays import Floats
from meshreel.errors import SolverError
from meshreel.runtime.fork import fork_safe_lock

Solve = Callable[[Floats], Floats]


class CholeskySolver:
    """Factor of a sparse symmetric positive definite matrix, for any number of right-hand sides.

    cholespy factors the matrix where it is installed, else SciPy's sparse LU, which gives the same
    result more slowly.

    Parameters
    ----------
    matrix : csc_array of shape (V, V)
        Both triangles filled, float64.

    Raises
    ------
    SolverError
        If the factorisation fails.
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
