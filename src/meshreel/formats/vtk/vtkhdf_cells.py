"""The cells of a step in a VTKHDF file, of one or several partitions."""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.hdf.reading import Dataset, Node, read_all, read_rows, require_dataset
from meshreel.formats.vtk.cells import Cells

Int64s = npt.NDArray[np.int64]

MAX_CELLS = 1 << 62
NO_CELLS = np.zeros(1, np.int64)


def read_cells(
    group: Node,
    kind: int | None,
    parts: slice,
    n_points: Int64s,
    first_cell: int,
    first_corner: int,
    cells_before: Int64s,
) -> Cells:
    """Cells of all partitions of a step, which name points through all of them.

    Parameters
    ----------
    group : h5py group
        Holds Connectivity and Offsets.
    kind : int or None
        Type of all cells; None if the group says it in Types.
    parts : slice
        The partitions of the step among those of the group.
    n_points : int64 array
        Points of each partition of the step; Points is known to have them.
    first_cell, first_corner : int
        Where cells and connectivity of the step begin.
    cells_before : int64 array of shape (partitions of the group + 1,)
        From `count_before`.

    Raises
    ------
    FormatError
        If a dataset is missing, too short, or does not fit the others.
    """
    n_cells = _of_parts(require_dataset(group, "NumberOfCells"), parts)
    n_corners = _of_parts(require_dataset(group, "NumberOfConnectivityIds"), parts)
    first_row = first_cell + _parts_before(cells_before, parts.start, first_cell)
    counts = list(_counts(require_dataset(group, "Offsets"), first_row, n_cells))
    connectivity = require_dataset(group, "Connectivity")
    corners = read_rows(connectivity, first_corner, sum(n_corners.tolist())).astype(np.int64)
    if (corners < 0).any() or (corners >= n_points.repeat(n_corners)).any():
        raise FormatError(f"{group.name}/Connectivity names points that are not there")
    if [int(one.sum()) for one in counts] != n_corners.tolist():
        raise FormatError(f"{group.name}/Offsets do not agree with NumberOfConnectivityIds")
    total = sum(n_cells.tolist())
    if kind is None:
        types = read_rows(require_dataset(group, "Types"), first_cell, total)
    else:
        types = np.full(total, kind)
    first_point = np.cumsum(n_points) - n_points
    return Cells(types, np.concatenate(counts), corners + first_point.repeat(n_corners))


def count_before(group: Node) -> Int64s:
    """Cells of the partitions of a group before each, and of all.

    Raises
    ------
    FormatError
        If a number is negative, or they are too many.
    """
    counts = integers(require_dataset(group, "NumberOfCells")).ravel()
    if len(counts) and (counts.min() < 0 or sum(counts.tolist()) > MAX_CELLS):
        raise FormatError(f"{group.name}/NumberOfCells are no numbers of cells")
    return np.concatenate([[0], np.cumsum(counts)])


def integers(dataset: Dataset) -> Int64s:
    """All of a dataset of whole numbers.

    Raises
    ------
    FormatError
        If it holds others.
    """
    values = read_all(dataset)
    if values.dtype.kind not in "iu":
        raise FormatError(f"{dataset.name} must be whole numbers; got {values.dtype}")
    return values.astype(np.int64)


def _of_parts(dataset: Dataset, parts: slice) -> Int64s:
    values = read_rows(dataset, parts.start, parts.stop - parts.start).astype(np.int64)
    if values.ndim != 1 or (values < 0).any():
        raise FormatError(f"{dataset.name} must be numbers of shape (N,), none negative")
    return values


def _parts_before(cells_before: Int64s, first_part: int, first_cell: int) -> int:
    """How many partitions have their offsets before those of a step.

    All that come before the step, or where it shares the cells of an earlier one, all before that.
    """
    if first_part < len(cells_before) and cells_before[first_part] == first_cell:
        return first_part
    return min(first_part, int(np.searchsorted(cells_before, first_cell)))


def _counts(offsets: Dataset, first_row: int, n_cells: Int64s) -> Iterator[Int64s]:
    """Points of each cell, for each partition, which has one offset more than cells.

    One without cells is not looked up, for its offset may be shared with others, or left out.
    """
    start = first_row
    for count in n_cells.tolist():
        ends = read_rows(offsets, start, count + 1).astype(np.int64) if count else NO_CELLS
        counts = np.diff(ends)
        if ends.ndim != 1 or (counts < 0).any():
            raise FormatError(f"{offsets.name} do not ascend")
        yield counts
        start += count + 1
