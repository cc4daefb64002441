"""In which order the columns of a row are coded, and what coded neighbours tell of the next.

A row is coded in passes, so that all columns of a pass can be worked on at once. What is coded
near a column, in an earlier pass, tells its likely magnitude and sign.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

Integers = npt.NDArray[np.int64]

MAX_SIGNED = 2  # larger magnitudes vote like this one


@dataclass(frozen=True)
class Pass:
    """Columns that are coded at once, and for each the neighbours that tell of it.

    Attributes
    ----------
    columns : int64 array of shape (n,)
        Of all passes together: every column once.
    indptr : int64 array of shape (n + 1,)
    indices : int64 array
        Neighbours of columns[i] are indices[indptr[i] : indptr[i + 1]], all in earlier passes.
    """

    columns: Integers
    indptr: Integers
    indices: Integers


def single_pass(n_columns: int) -> list[Pass]:
    """All columns at once, without neighbours."""
    nothing = np.zeros(0, np.int64)
    return [Pass(np.arange(n_columns), np.zeros(n_columns + 1, np.int64), nothing)]


def in_coded_order(passes: Sequence[Pass]) -> tuple[Integers, list[Pass]]:
    """All columns in the order they are coded in, and passes that number them so.

    Columns of a pass then follow each other: they are a slice of what is kept for all.
    """
    order = np.concatenate([step.columns for step in passes])
    number = np.empty(len(order), np.int64)
    number[order] = np.arange(len(order))
    return order, [Pass(number[step.columns], step.indptr, number[step.indices]) for step in passes]


class Neighbourhood:
    """Sums over the neighbours of a pass, and how far they agreed in sign so far.

    Neighbours agree where they had the same sign in the rows before. How much they agreed weighs
    the vote of the one for the sign of the other; where they disagreed it counts the other way.

    Attributes
    ----------
    columns : integer array of shape (n,)
    span : slice
        The columns too, if they are in coded order.
    """

    def __init__(self, step: Pass, n_columns: int) -> None:
        self.columns = step.columns
        self.span = slice(int(step.columns[0]), int(step.columns[-1]) + 1)
        ones = np.ones(len(step.indices), np.int64)
        shape = (len(step.columns), n_columns)
        self._near: csr_array = csr_array((ones, step.indices, step.indptr), shape=shape)
        self._agreement = self._near.copy()  # 1 to begin with: neighbours mostly agree
        self._targets = np.repeat(step.columns, np.diff(step.indptr))

    def sum_near(self, values: Integers) -> Integers:
        """Sum over the neighbours, of shape (n, rows), of values of shape (columns, rows)."""
        return np.asarray(self._near @ values)

    def predict_signs(self, signed: Integers) -> Integers:
        """What the neighbours vote for, of shape (n, rows); see `signed_votes`."""
        return np.asarray(self._agreement @ signed)

    def learn(self, signed: npt.NDArray[np.integer], votes: npt.NDArray[np.bool_]) -> None:
        """Take in rows that are coded.

        Parameters
        ----------
        signed : integer array of shape (columns, rows)
            Votes; at most 31 rows.
        votes : bool array of shape (columns,)
            Whether a column has any vote: most have none.
        """
        near = self._agreement.indices
        both = np.flatnonzero(votes[self._targets] & votes[near])
        targets = signed[self._targets[both]]
        self._agreement.data[both] += np.einsum("ij,ij->i", targets, signed[near[both]])


def neighbourhoods(passes: Sequence[Pass], n_columns: int) -> list[Neighbourhood]:
    """One for each pass that has columns."""
    return [Neighbourhood(step, n_columns) for step in passes if len(step.columns)]


def signed_votes(values: Integers) -> Integers:
    """Values as votes for a sign."""
    return np.minimum(np.maximum(values, -MAX_SIGNED), MAX_SIGNED)
