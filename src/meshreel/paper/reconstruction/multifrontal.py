"""Multifrontal Cholesky factorisation: a sparse factorisation made of dense ones."""

import numpy as np
import numpy.typing as npt
from scipy.linalg.blas import dsyrk, dtrsm
from scipy.linalg.lapack import dpotrf
from scipy.sparse import csc_array, csr_array, tril

from meshreel.errors import SolverError
from meshreel.paper.reconstruction.assembly_tree import Front, elimination_of, fronts_of
from meshreel.paper.reconstruction.dissection import nested_dissection
from meshreel.runtime.threads import chunks, in_threads

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

MAX_ENTRIES_EACH = 1000
"""Largest number of entries per unknown of large systems: meshes take 100 to 400."""

FREE_ENTRIES = 1 << 26
"""Entries that any system may have: half a gigabyte."""

COLUMNS_AT_ONCE = 32
"""Right-hand sides that one thread solves at a time."""


class MultifrontalSolver:
    """Factor of a sparse symmetric positive definite matrix, for any number of right-hand sides.

    Separators of nested dissection are dense when they are eliminated: they are factored as dense
    matrices, on all cores, at ten times the speed of sparse arithmetic. The result does not
    depend on the number of cores.

    Parameters
    ----------
    matrix : csc_array of shape (V, V)
        Both triangles filled, float64.
    graph : csr_array of shape (V, V)
        The graph of distances for `nested_dissection`.
    max_entries : int, optional
        Limit on the entries of the factor. Default: more than a mesh of V vertices needs.

    Raises
    ------
    SolverError
        If the factor would have more, or the matrix is not positive definite to working precision.

    References
    ----------
    I. S. Duff, J. K. Reid, "The multifrontal solution of indefinite sparse symmetric linear
    equations", 1983. J. W. H. Liu, "The multifrontal method for sparse matrix solution: theory
    and practice", 1992.
    """

    def __init__(self, matrix: csc_array, graph: csr_array, max_entries: int | None = None) -> None:
        elimination = elimination_of(nested_dissection(matrix, graph))
        self._order = elimination.order
        lower = _lower_triangle(matrix, self._order)
        self._fronts = fronts_of(lower, elimination.ends)
        _check_size(self._fronts, max_entries or _most_entries(matrix.shape[0]))
        self._factors = _Factors(lower, self._fronts)
        for wave in elimination.waves():
            in_threads(self._factors.eliminate, wave)

    def solve(self, right: Floats) -> Floats:
        """Solution of shape (V, K) for right-hand sides of shape (V, K)."""
        solution = np.empty_like(right)

        def solve(columns: slice) -> None:
            values = np.ascontiguousarray(right[:, columns][self._order])
            self._substitute(values)
            solution[:, columns][self._order] = values

        in_threads(solve, chunks(right.shape[1], COLUMNS_AT_ONCE))
        return solution

    def _substitute(self, values: Floats) -> None:
        """Solve in place by forward and backward substitution."""
        done = list(zip(self._fronts, self._factors.own, self._factors.below, strict=True))
        for front, own, below in done:
            head = values[front.start : front.stop]
            # Rows of a C array are columns of its transpose, as LAPACK expects.
            head[:] = dtrsm(1.0, own, head.T, side=1, lower=1, trans_a=1, overwrite_b=1).T
            if len(front.rows):
                values[front.rows] -= below @ head
        for front, own, below in reversed(done):
            head = values[front.start : front.stop]
            if len(front.rows):
                head -= below.T @ values[front.rows]
            head[:] = dtrsm(1.0, own, head.T, side=1, lower=1, overwrite_b=1).T


class _Factors:
    """Columns of the Cholesky factor, front by front; upper triangles are undefined."""

    def __init__(self, lower: csc_array, fronts: list[Front]) -> None:
        self._lower = lower
        self._fronts = fronts
        nothing = np.zeros((0, 0))
        self.own = [nothing] * len(fronts)
        self.below = [nothing] * len(fronts)
        self._updates = [nothing] * len(fronts)

    def eliminate(self, numbers: range) -> None:
        """Factor fronts one after another; their children are factored or among them."""
        for number in numbers:
            self._eliminate(number)

    def _eliminate(self, number: int) -> None:
        own, below, update = self._assembled(self._fronts[number])
        own, failure = dpotrf(own, lower=1, clean=0, overwrite_a=1)
        if failure:
            raise SolverError(
                "the reconstruction system is not positive definite to working precision; more "
                "anchors make it better conditioned"
            )
        if len(below):
            below = dtrsm(1.0, own, below, side=1, lower=1, trans_a=1, overwrite_b=1)
            update = dsyrk(-1.0, below, beta=1.0, c=update, lower=1, overwrite_c=1)
        self.own[number], self.below[number], self._updates[number] = own, below, update

    def _assembled(self, front: Front) -> tuple[Floats, Floats, Floats]:
        """The frontal matrix: its own square, the rows below, and their update matrix."""
        size, n_rows = front.stop - front.start, len(front.rows)
        own, below, update = (
            np.zeros(shape, order="F") for shape in ((size, size), (n_rows, size), (n_rows, n_rows))
        )
        self._add_entries(front, own, below)
        for child in front.children:
            self._add_update(front, child, own, below, update)
        return own, below, update

    def _add_entries(self, front: Front, own: Floats, below: Floats) -> None:
        indptr = self._lower.indptr[front.start : front.stop + 1]
        rows = self._lower.indices[indptr[0] : indptr[-1]]
        values = self._lower.data[indptr[0] : indptr[-1]]
        columns = np.repeat(np.arange(front.stop - front.start), np.diff(indptr))
        inside = rows < front.stop
        own[rows[inside] - front.start, columns[inside]] = values[inside]
        outside = ~inside
        places = np.searchsorted(front.rows, rows[outside])
        below[places, columns[outside]] = values[outside]

    def _add_update(
        self, front: Front, child: int, own: Floats, below: Floats, update: Floats
    ) -> None:
        rows, updates = self._fronts[child].rows, self._updates[child]
        n_inside = int(np.searchsorted(rows, front.stop))
        inside = rows[:n_inside] - front.start
        outside = np.searchsorted(front.rows, rows[n_inside:])
        _add_at(own, inside, inside, updates[:n_inside, :n_inside])
        _add_at(below, outside, inside, updates[n_inside:, :n_inside])
        _add_at(update, outside, outside, updates[n_inside:, n_inside:])
        self._updates[child] = np.zeros((0, 0))


def _add_at(matrix: Floats, rows: Integers, columns: Integers, values: Floats) -> None:
    """Add values at distinct rows and columns of a Fortran array (in place)."""
    # One flat index is twice as fast as two.
    places = (columns[:, None] * matrix.shape[0] + rows).ravel()
    matrix.T.reshape(-1)[places] += values.T.ravel()


def _lower_triangle(matrix: csc_array, order: Integers) -> csc_array:
    """Lower triangle of the matrix with its rows and columns in this order, indices sorted."""
    lower = csc_array(tril(matrix[:, order][order], format="csc"))
    lower.sort_indices()
    return lower


def _most_entries(n_unknowns: int) -> int:
    return max(FREE_ENTRIES, MAX_ENTRIES_EACH * n_unknowns)


def _check_size(fronts: list[Front], limit: int) -> None:
    n_entries = sum(front.n_entries for front in fronts)
    if n_entries > limit:
        raise SolverError(
            f"the fronts of the reconstruction system hold {n_entries} entries; {limit} are "
            "allowed: unknowns are coupled to too many others"
        )
