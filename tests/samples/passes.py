"""Small passes shared by tests."""

import numpy as np

from meshreel.kernel.fields import coding_order


def as_order(*passes):
    """Return a coding order of passes (columns, near); near[i] lists neighbors of columns[i]."""
    columns = [column for part, _ in passes for column in part]
    near = [list(neighbors) for _, part in passes for neighbors in part]
    width = max(map(len, near), default=0)
    padded = np.full((len(near), width), -1)
    for row, neighbors in zip(padded, near, strict=True):
        row[: len(neighbors)] = neighbors
    starts = np.cumsum([0, *(len(part) for part, _ in passes)], dtype=np.int64)
    return coding_order(padded, starts)._replace(columns=np.array(columns, np.int32))


def passes_of(order):
    """Return columns and lists of their context neighbors of each pass of a coding order."""
    near = np.split(order.near, order.near_starts[1:-1]) if order.n_columns else []
    bounds = zip(order.pass_starts[:-1], order.pass_starts[1:], strict=True)
    return [
        (order.columns[start:end], [row.tolist() for row in near[start:end]])
        for start, end in bounds
    ]


def line_passes(n_columns, coarsest=8):
    """Return an order that bisects a line: every eighth column first, then those between."""
    first = np.arange(0, n_columns, coarsest)
    passes = [(first, [[]] * len(first))]
    while coarsest > 1:
        half = coarsest // 2
        columns = range(half, n_columns, coarsest)
        near = [[i - half] + [i + half] * (i + half < n_columns) for i in columns]
        passes.append((columns, near))
        coarsest = half
    return as_order(*passes)
