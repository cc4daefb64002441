"""Passes of columns, the order in which a row is coded, and the context neighbours of each column.

A row is coded in passes, so that all columns of a pass can be worked on at once. The context
neighbours of a column lie in earlier passes; their values give the context of its magnitude and
predict its sign.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

Integers = npt.NDArray[np.int64]

MAX_SIGNED = 2  # larger magnitudes count as this in the prediction of a sign


@dataclass(frozen=True)
class Pass:
    """Columns that are coded at once, and the context neighbours of each.

    Attributes
    ----------
    columns : int64 array of shape (n,)
        Every column is in exactly one pass of a row.
    indptr : int64 array of shape (n + 1,)
    indices : int64 array
        The context neighbours of columns[i] are indices[indptr[i] : indptr[i + 1]], all in earlier
        passes.
    """

    columns: Integers
    indptr: Integers
    indices: Integers


def single_pass(n_columns: int) -> list[Pass]:
    """The pass that holds all columns, without context neighbours."""
    nothing = np.zeros(0, np.int64)
    return [Pass(np.arange(n_columns), np.zeros(n_columns + 1, np.int64), nothing)]


def in_coded_order(passes: Sequence[Pass]) -> tuple[Integers, list[Pass]]:
    """The columns in coding order, and the passes with columns numbered in that order.

    The columns of a pass are then consecutive: a slice of the arrays over all columns.
    """
    order = np.concatenate([one.columns for one in passes])
    number = np.empty(len(order), np.int64)
    number[order] = np.arange(len(order))
    return order, [Pass(number[one.columns], one.indptr, number[one.indices]) for one in passes]


class Neighbourhood:
    """Sums over the context neighbours of a pass, and how far signs agreed so far.

    Two columns agree where they had the same sign in the rows before. The agreement is the weight
    of a neighbour in the prediction of a sign; it is negative where signs mostly differed.

    Attributes
    ----------
    columns : integer array of shape (n,)
    span : slice
        The same columns, if they are in coding order.
    """

    def __init__(self, coded: Pass, n_columns: int) -> None:
        self.columns = coded.columns
        self.span = slice(int(coded.columns[0]), int(coded.columns[-1]) + 1)
        ones = np.ones(len(coded.indices), np.int64)
        shape = (len(coded.columns), n_columns)
        self._near: csr_array = csr_array((ones, coded.indices, coded.indptr), shape=shape)
        self._agreement = self._near.copy()  # 1 to begin with: neighbours mostly agree
        self._column_of_pair = np.repeat(coded.columns, np.diff(coded.indptr))

    def sum_near(self, values: Integers) -> Integers:
        """Sums over the context neighbours, of shape (n, rows).

        Parameters
        ----------
        values : integer array of shape (columns, rows)
        """
        return np.asarray(self._near @ values)

    def predict_signs(self, signed: Integers) -> Integers:
        """Predictions of signs, of shape (n, rows); 0 predicts none.

        Parameters
        ----------
        signed : integer array of shape (columns, rows)
            From `limited_signs`.
        """
        return np.asarray(self._agreement @ signed)

    def learn(self, signed: npt.NDArray[np.integer], is_used: npt.NDArray[np.bool_]) -> None:
        """Update the agreement with rows that are coded.

        Parameters
        ----------
        signed : integer array of shape (columns, rows)
            From `limited_signs`; at most 31 rows.
        is_used : bool array of shape (columns,)
            Whether a column has any value that is not 0: most have none.
        """
        near = self._agreement.indices
        both = np.flatnonzero(is_used[self._column_of_pair] & is_used[near])
        own = signed[self._column_of_pair[both]]
        self._agreement.data[both] += np.einsum("ij,ij->i", own, signed[near[both]])


def neighbourhoods(passes: Sequence[Pass], n_columns: int) -> list[Neighbourhood]:
    """The neighbourhood of each pass that has columns."""
    return [Neighbourhood(one, n_columns) for one in passes if len(one.columns)]


def limited_signs(values: Integers) -> Integers:
    """The values limited to -MAX_SIGNED..MAX_SIGNED: what they count in predictions of signs."""
    return np.minimum(np.maximum(values, -MAX_SIGNED), MAX_SIGNED)
