"""The cells of a step in a VTKHDF file, of one or several partitions."""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.hdf_file import Dataset, Node, read_all, read_rows, require_dataset
from meshreel.formats.vtk.cells import Cells

Int64s = npt.NDArray[np.int64]


def read_cells(
    group: Node,
    kind: int | None,
    parts: slice,
    n_points: Int64s,
    first_cell: int,
    first_corner: int,
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

    Raises
    ------
    FormatError
        If a dataset is missing, too short, or does not fit the others.
    """
    n_cells = _of_parts(require_dataset(group, "NumberOfCells"), parts)
    n_corners = _of_parts(require_dataset(group, "NumberOfConnectivityIds"), parts)
    counts = list(_counts(require_dataset(group, "Offsets"), first_cell, n_cells, parts.start))
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


def _counts(
    offsets: Dataset, first_cell: int, n_cells: Int64s, first_part: int
) -> Iterator[Int64s]:
    """Points of each cell, for each partition, which has one offset more than cells."""
    start = first_cell
    for part, count in enumerate(n_cells.tolist(), first_part):
        ends = read_rows(offsets, start + part, count + 1).astype(np.int64)
        counts = np.diff(ends)
        if ends.ndim != 1 or (counts < 0).any():
            raise FormatError(f"{offsets.name} do not ascend")
        yield counts
        start += count
