"""From which rows of a table each other row is expected, where the table itself says it."""

import numpy as np

from meshreel.kernel.patterns import Expected


def nothing_expected(n_rows: int) -> Expected:
    """Rows one after another, none expected from others."""
    return Expected(_in_order(n_rows), np.zeros(n_rows + 1, np.int64), np.zeros((0, 3), np.int32))


def row_before_expected(n_rows: int) -> Expected:
    """Rows one after another, each expected to be as the one before."""
    before = np.arange(max(n_rows - 1, 0), dtype=np.int32)
    triples = np.stack([before, before, np.full_like(before, -1)], axis=1)
    return Expected(_in_order(n_rows), _one_each_but_the_first(n_rows), triples)


def same_step_expected(n_rows: int) -> Expected:
    """Rows one after another, each expected to be as far from the one before as that from its own.

    The second is expected to be as the first.
    """
    expected = row_before_expected(n_rows)
    expected.triples[1:, 2] = expected.triples[:-1, 0]
    return expected


def _in_order(n_rows: int) -> np.ndarray[tuple[int], np.dtype[np.int32]]:
    return np.arange(n_rows, dtype=np.int32)


def _one_each_but_the_first(n_rows: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    return np.maximum(np.arange(-1, n_rows, dtype=np.int64), 0)
