"""Passes over few columns that tests share."""

import numpy as np

from meshreel.kernel.fields import Pass


def as_pass(columns, near):
    """A pass of columns, of which near[i] lists the neighbours of columns[i]."""
    counts = [len(one) for one in near]
    return Pass(
        np.array(columns, np.int64),
        np.cumsum([0, *counts]),
        np.array([index for one in near for index in one], np.int64),
    )


def line_passes(n_columns, coarsest=8):
    """Every eighth column first, then those half-way between, ...: each between two of before."""
    first = np.arange(0, n_columns, coarsest)
    passes = [as_pass(first, [[]] * len(first))]
    while coarsest > 1:
        half = coarsest // 2
        columns = range(half, n_columns, coarsest)
        passes.append(
            as_pass(columns, [[i - half] + [i + half] * (i + half < n_columns) for i in columns])
        )
        coarsest = half
    return passes
