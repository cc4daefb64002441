"""Small passes shared by tests."""

import numpy as np

from meshreel.kernel.fields import Pass


def as_pass(columns, near):
    """Return a pass of columns; near[i] lists the neighbors of columns[i]."""
    counts = [len(neighbors) for neighbors in near]
    return Pass(
        np.array(columns, np.int64),
        np.cumsum([0, *counts]),
        np.array([index for neighbors in near for index in neighbors], np.int64),
    )


def line_passes(n_columns, coarsest=8):
    """Return passes that bisect a line: every eighth column first, then those between."""
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
