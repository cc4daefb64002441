"""In which order the columns of a row are coded, and what coded neighbours tell of the next.

A row is coded in a few passes, so that all columns of a pass can be worked on at once. Two
columns of one pass are no neighbours, if the pass is not the last.
"""

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

Integers = npt.NDArray[np.int64]
Neighbours = tuple[Integers, Integers]
"""Neighbours of column i are indices[indptr[i] : indptr[i + 1]], as in a sparse matrix."""

N_PASSES = 4
MAX_ROUNDS = 12
PRIORITY_FACTOR = 2654435761  # scatters column numbers; being odd, it gives no two the same
MAX_SIGNED = 2  # larger magnitudes vote like this one


class Pass:
    """Columns coded at once, and their neighbours coded in earlier passes.

    Neighbours agree where they had the same sign in the rows before. How much they agreed weighs
    the vote of the one for the sign of the other; where they disagreed it counts the other way.

    Attributes
    ----------
    columns : integer array of shape (n,)
    n_near : integer array of shape (n,)
        How many coded neighbours each has.
    """

    def __init__(self, columns: Integers, adjacency: csr_array) -> None:
        self.columns = columns
        self._adjacency = csr_array(adjacency[columns])
        self.n_near = np.diff(self._adjacency.indptr).astype(np.int64)
        self._agreement = self._adjacency.copy()  # 1 to begin with: neighbours mostly agree
        self._targets = np.repeat(columns, self.n_near)

    def magnitudes_near(self, magnitudes: Integers) -> Integers:
        """Sum over the coded neighbours, of shape (n,), of magnitudes of all columns."""
        return np.asarray(self._adjacency @ magnitudes)

    def predict_signs(self, signed: Integers) -> Integers:
        """What the coded neighbours vote for, of shape (n,); see `signed_votes`."""
        return np.asarray(self._agreement @ signed)

    def learn(self, signed: Integers) -> None:
        """Take in a row that is coded."""
        self._agreement.data += signed[self._targets] * signed[self._adjacency.indices]


def signed_votes(values: Integers) -> Integers:
    """Values as votes for a sign."""
    return np.clip(values, -MAX_SIGNED, MAX_SIGNED)


def plan_passes(n_columns: int, neighbours: Neighbours | None) -> list[Pass]:
    """Passes that take every column once; one pass if there are no neighbours."""
    if neighbours is None:
        neighbours = (np.zeros(n_columns + 1, np.int64), np.zeros(0, np.int64))
    indptr, sources = neighbours
    targets = np.repeat(np.arange(n_columns), np.diff(indptr))
    number = _pass_numbers(n_columns, targets, sources)
    coded = number[sources] < number[targets]
    ones = np.ones(int(coded.sum()), np.int64)
    adjacency: csr_array = csr_array(
        (ones, (targets[coded], sources[coded])), shape=(n_columns, n_columns)
    )
    plan = [np.flatnonzero(number == k) for k in range(N_PASSES)]
    return [Pass(columns, adjacency) for columns in plan if len(columns)]


def _pass_numbers(n_columns: int, targets: Integers, sources: Integers) -> Integers:
    """Pass of each column: sets without neighbours among them (M. Luby, 1986), then the rest."""
    priority = 1 + (np.arange(n_columns, dtype=np.int64) * PRIORITY_FACTOR & 0xFFFFFFFF)
    number = np.full(n_columns, N_PASSES - 1)
    for k in range(N_PASSES - 1):
        free = number == N_PASSES - 1
        for _ in range(MAX_ROUNDS):
            bids = np.where(free, priority, 0)
            highest = np.zeros(n_columns, np.int64)
            np.maximum.at(highest, targets, bids[sources])
            chosen = bids > highest
            number[chosen] = k
            free[chosen] = False
            free[targets[chosen[sources]]] = False
            if not free.any():
                break
    return number
