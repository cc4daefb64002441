"""The time steps of a VTKHDF mesh, and the cells of each step."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Integers
from meshreel.errors import FormatError
from meshreel.formats.frames.field_tracks import Field
from meshreel.formats.frames.steps import UNSUPPORTED_ARRAYS, DataArray, Step, note_unreadable
from meshreel.formats.hdf import (
    Dataset,
    Node,
    find_dataset,
    find_group,
    hdf_errors,
    read_all,
    read_rows,
    read_text_attribute,
    read_unit,
    require_dataset,
    unread_datasets,
)
from meshreel.formats.surfaces.cells import (
    POLY_LINE,
    POLY_VERTEX,
    POLYGON,
    STRIP,
    VTK_POLYHEDRON,
    Cells,
    CellSurface,
    cell_mesh,
)
from meshreel.formats.vtk.xml_arrays import SUBJECTS
from meshreel.model.notes import Notes
from meshreel.model.surface import Domain
from meshreel.runtime.counting import counted

ROOT = "VTKHDF"
DATA = {"PointData": Domain.VERTEX, "CellData": Domain.FACE}
DATA_GROUPS = {domain: name for name, domain in DATA.items()} | {Domain.CELL: "CellData"}

POLY_DATA_GROUPS: dict[str, int | None] = {
    "Vertices": POLY_VERTEX,
    "Lines": POLY_LINE,
    "Polygons": POLYGON,
    "Strips": STRIP,
}
"""Cell groups of PolyData and their cell types, in the column order of the step offsets."""

GRID_GROUPS: dict[str, int | None] = {"": None}
"""The same for an UnstructuredGrid, which stores cell types."""

IS_ATTRIBUTE = "is_attribute"
"""HDF5 attribute of meshreel's arrays that change only with the faces."""

MAX_CELLS = 1 << 62
NO_CELLS = np.zeros(1, np.int64)


class VtkSteps:
    """The frames of a VTKHDF group of type PolyData or UnstructuredGrid.

    Parameters
    ----------
    group : h5py group
    is_poly_data : bool
        Whether the type is PolyData rather than UnstructuredGrid.
    notes : Notes
        Receives a sentence for each thing that is left out.

    Raises
    ------
    FormatError
        If a required dataset is missing, or the step datasets are inconsistent.
    """

    def __init__(self, group: Node, *, is_poly_data: bool, notes: Notes) -> None:
        self._group, self._notes = group, notes
        self._taken: set[str] = set()
        self._find = partial(find_dataset, taken=self._taken)
        self._require = partial(require_dataset, taken=self._taken)
        self._steps = find_group(group, "Steps")
        self._points = self._require(group, "Points")
        if len(self._points.shape) != 2 or self._points.shape[1] != 3:
            raise FormatError(f"Points must have shape (N, 3); got {self._points.shape}")
        if self._points.dtype.kind != "f" or self._points.dtype.itemsize not in (4, 8):
            raise FormatError(f"Points must be float32 or float64; got {self._points.dtype}")
        self._kinds = POLY_DATA_GROUPS if is_poly_data else GRID_GROUPS
        self._n_points = read_integers(self._require(group, "NumberOfPoints"))
        self.times_s: Floats = self._read_times()
        self._first_part = self._per_step("PartOffsets")
        all_parts = len(self._n_points) if self._steps is None else 1
        self._n_parts = self._per_step("NumberOfParts", default=all_parts)
        self._point_starts = self._per_step("PointOffsets")
        self._cell_starts = self._per_step("CellOffsets", len(self._kinds))
        self._corner_starts = self._per_step("ConnectivityIdOffsets", len(self._kinds))
        self._cells_before: dict[str, Integers] = {}
        self._cached: tuple[bytes, Cells, CellSurface] | None = None

    def note_unread(self) -> None:
        """Note the datasets that the steps read so far do not use."""
        for name in unread_datasets(self._group, self._taken):
            folder, _, leaf = name.rpartition("/")
            if not folder.startswith("Steps"):  # tables of rows
                self._notes.left_out(SUBJECTS.get(folder, "datasets"), [leaf])

    def step(self, index: int) -> Step:
        """Return a step."""
        cells, surface = self._surface(index)
        n_points, n_cells = self._points_of(index), len(cells.types)
        start = int(self._point_starts[index, 0])
        return Step(
            n_points,
            n_cells,
            surface,
            partial(read_rows, self._points, start, n_points),
            [
                array.of_step(index, n_points if array.domain is Domain.VERTEX else n_cells)
                for array in self._arrays
            ],
        )

    @cached_property
    def _arrays(self) -> list["StoredArray"]:
        """The arrays at points and cells; the notes list those that cannot be read."""
        return [array for group_name in DATA for array in self._stored_arrays(group_name)]

    def _read_times(self) -> Floats:
        if self._steps is None:
            return np.zeros(1)
        values = read_all(self._require(self._steps, "Values")).ravel()
        times: Floats = values.astype(np.result_type(values, np.float32), copy=False)
        n_steps: Any = np.ravel(self._steps.attrs.get("NSteps", len(times)))
        if len(times) == 0 or n_steps.tolist() != [len(times)]:
            raise FormatError(f"declares {n_steps.tolist()} steps, but has {len(times)} times")
        if not np.isfinite(times).all() or (np.diff(times) <= 0).any():
            raise FormatError("has step times that are not ascending; the file is damaged")
        return times

    def _per_step(self, name: str, width: int = 1, default: int = 0) -> Integers:
        """Read a dataset of integers for each step, of shape (T, width)."""
        shape = len(self.times_s), width
        dataset = self._find(self._steps, name) if self._steps is not None else None
        if dataset is None:
            return np.full(shape, default, np.int64)
        values = read_integers(dataset)
        if values.size != shape[0] * width or values.min() < 0:
            raise FormatError(
                f"Steps/{name} must be non-negative of shape {shape}; got {values.shape}"
            )
        return values.reshape(shape)

    def _parts(self, index: int) -> slice:
        first, count = int(self._first_part[index, 0]), int(self._n_parts[index, 0])
        if count < 1 or first + count > len(self._n_points):
            raise FormatError(
                f"step {index} has partitions {first} to {first + count - 1} of "
                f"{len(self._n_points)}"
            )
        return slice(first, first + count)

    def _points_of(self, index: int) -> int:
        """Number of points of a step, checked against the rows of Points."""
        start = int(self._point_starts[index, 0])
        count = int(sum(self._n_points[self._parts(index)].tolist()))
        if start + count > len(self._points) or count < 0:
            raise FormatError(
                f"Points has {counted(len(self._points), 'row')}; step {index} has {count} "
                f"from row {start} on"
            )
        return count

    def _surface(self, index: int) -> tuple[Cells, CellSurface]:
        """Return the cells of a step and their surface, cached for steps that share them."""
        parts = self._parts(index)
        key = np.concatenate(
            [[parts.start, parts.stop], self._cell_starts[index], self._corner_starts[index]]
        ).tobytes()
        if self._cached is None or self._cached[0] != key:
            cells = self._cells(index, parts)
            self._cached = key, cells, cell_mesh(cells, self._points_of(index))
        return self._cached[1:]

    def _cells(self, index: int, parts: slice) -> Cells:
        cells = []
        for column, (name, kind) in enumerate(self._kinds.items()):
            group = find_group(self._group, name) if name else self._group
            starts = int(self._cell_starts[index, column]), int(self._corner_starts[index, column])
            if group is None:
                continue
            require = partial(self._require, group)
            if name not in self._cells_before:
                self._cells_before[name] = cells_before_partitions(require)
            points, cells_before = self._n_points[parts], self._cells_before[name]
            cells.append(read_cells(require, kind, parts, points, *starts, cells_before))
        if not cells:
            raise FormatError(f"{self._group.name} has none of {', '.join(self._kinds)}")
        return self._with_polyhedra(Cells.join(cells))

    def _with_polyhedra(self, cells: Cells) -> Cells:
        """Return cells with their polyhedra; they are not read from files of several partitions."""
        if len(self._n_points) > 1 or not (cells.types == VTK_POLYHEDRON).any():
            return cells

        def read(offsets: str, name: str) -> tuple[Integers, Integers]:
            ends, values = (
                read_integers(self._require(self._group, path)).ravel() for path in (offsets, name)
            )
            counts = np.diff(ends)
            if (counts < 0).any() or ends[:1].tolist() != [0] or ends[-1] != len(values):
                raise FormatError(f"{offsets} do not fit the {len(values)} numbers of {name}")
            return counts, values

        faces = read("PolyhedronOffsets", "PolyhedronToFaces")
        return cells.with_faces(*faces, *read("FaceOffsets", "FaceConnectivity"))

    def _stored_arrays(self, group_name: str) -> Iterator["StoredArray"]:
        """Yield the arrays at points or cells that have rows for each step."""
        group = find_group(self._group, group_name)
        n_steps = len(self.times_s)
        for name in group if group is not None else ():
            try:
                dataset = self._find(group, name)
            except FormatError as error:
                note_unreadable((DATA[group_name], name), error, self._notes)
                continue
            if dataset is None or dataset.dtype.kind not in "iuf" or not dataset.shape:
                self._notes.left_out(UNSUPPORTED_ARRAYS, [name])
                continue
            offsets_name = f"Steps/{group_name}Offsets/{name}"
            offsets = self._find(self._group, offsets_name)
            is_at_points = group_name == "PointData"
            starts = self._point_starts[:, 0] if is_at_points else self._cell_starts.sum(axis=1)
            starts = starts if offsets is None else read_integers(offsets).ravel()
            # VTK appends the end of the last step; it skips steps without the array, unmarked.
            if len(starts) not in (n_steps, n_steps + 1):
                self._notes.left_out(
                    f"arrays: {name}, with offsets for {len(starts)} of {counted(n_steps, 'step')}",
                )
                continue
            yield StoredArray(name, DATA[group_name], dataset, starts[:n_steps])


@dataclass(frozen=True, eq=False)
class StoredArray:
    """Values at the points or cells of all steps, concatenated in one dataset."""

    name: str
    domain: Domain
    dataset: Dataset
    starts: Integers
    """int64 array of shape (T,). The first row of each step."""

    def of_step(self, index: int, count: int) -> DataArray:
        """Return the array of a step with a number of points or cells."""
        start = int(self.starts[index])
        role, kind = (read_text_attribute(self.dataset, name) for name in ("Attribute", "kind"))

        def describe() -> Field:
            if not 0 <= start <= len(self.dataset) - count:
                raise FormatError(
                    f"has {counted(len(self.dataset), 'row')}; step {index} needs {count} from row "
                    f"{start} on"
                )
            return Field(
                self.dataset.dtype.newbyteorder("="),
                math.prod(self.dataset.shape[1:]),
                role,
                kind,
                read_unit(self.dataset),
            )

        def read() -> npt.NDArray[Any]:
            with hdf_errors():
                return read_rows(self.dataset, start, count)

        return DataArray(
            self.domain,
            read_text_attribute(self.dataset, "name") or self.name,
            read,
            lambda: start,
            describe,
            is_track=read_text_attribute(self.dataset, "domain") in set(Domain),
            is_attribute=bool(self.dataset.attrs.get(IS_ATTRIBUTE, False)),
        )


def read_cells(
    require: Callable[[str], Dataset],
    kind: int | None,
    parts: slice,
    n_points: Integers,
    first_cell: int,
    first_corner: int,
    cells_before: Integers,
) -> Cells:
    """Read the cells of all partitions of a step, with point indices that count through all.

    Parameters
    ----------
    require : function of a name
        Returns a dataset of the group with Connectivity and Offsets.
    kind : int or None
        Type of all cells; None if the group has a dataset Types.
    parts : slice
        Partitions of the step, as a slice of all partitions.
    n_points : int64 array
        Number of points of each partition of the step; already checked against Points.
    first_cell, first_corner : int
        First row of the step's cells and of its connectivity.
    cells_before : int64 array of shape (partitions of the group + 1,)
        Result of `cells_before_partitions`.

    Raises
    ------
    FormatError
        If a dataset is missing, too short, or inconsistent with the others.
    """
    n_cells = _read_counts(require("NumberOfCells"), parts)
    n_corners = _read_counts(require("NumberOfConnectivityIds"), parts)
    first_row = first_cell + _offset_rows_before(cells_before, parts.start, first_cell)
    offsets = require("Offsets")
    counts = list(_cell_sizes(offsets, first_row, n_cells))
    connectivity = require("Connectivity")
    corners = read_rows(connectivity, first_corner, sum(n_corners.tolist())).astype(np.int64)
    if (corners < 0).any() or (corners >= n_points.repeat(n_corners)).any():
        raise FormatError(f"{connectivity.name} has point indices out of range")
    if [int(count.sum()) for count in counts] != n_corners.tolist():
        raise FormatError(f"{offsets.name} do not agree with NumberOfConnectivityIds")
    total = sum(n_cells.tolist())
    types = np.full(total, kind or 0)
    if kind is None:
        types = read_rows(require("Types"), first_cell, total)
    first_point = np.cumsum(n_points) - n_points
    return Cells(types, np.concatenate(counts), corners + first_point.repeat(n_corners))


def cells_before_partitions(require: Callable[[str], Dataset]) -> Integers:
    """Return the number of cells before each partition of a group, and the total.

    Raises
    ------
    FormatError
        If a count is negative, or the total is too large.
    """
    dataset = require("NumberOfCells")
    counts = read_integers(dataset).ravel()
    if len(counts) and (counts.min() < 0 or sum(counts.tolist()) > MAX_CELLS):
        raise FormatError(f"{dataset.name} has counts that are negative or too large")
    return np.concatenate([[0], np.cumsum(counts)])


def read_integers(dataset: Dataset) -> Integers:
    """Read a whole dataset of integers.

    Raises
    ------
    FormatError
        If it contains other types.
    """
    values = read_all(dataset)
    if values.dtype.kind not in "iu":
        raise FormatError(f"{dataset.name} must be integers; got {values.dtype}")
    return values.astype(np.int64)


def _read_counts(dataset: Dataset, parts: slice) -> Integers:
    values = read_rows(dataset, parts.start, parts.stop - parts.start).astype(np.int64)
    if values.ndim != 1 or (values < 0).any():
        raise FormatError(f"{dataset.name} must be non-negative numbers of shape (N,)")
    return values


def _offset_rows_before(cells_before: Integers, first_part: int, first_cell: int) -> int:
    """Number of partitions whose rows in Offsets precede those of a step.

    Each partition has one row more than cells. A step that shares the cells of an earlier step
    starts at the rows of that one.
    """
    if first_part < len(cells_before) and cells_before[first_part] == first_cell:
        return first_part
    return min(first_part, int(np.searchsorted(cells_before, first_cell)))


def _cell_sizes(offsets: Dataset, first_row: int, n_cells: Integers) -> Iterator[Integers]:
    """Yield the point counts of the cells of each partition, from its n_cells + 1 offsets.

    Offsets of empty partitions are not read: files may share or omit them.
    """
    start = first_row
    for count in n_cells.tolist():
        ends = read_rows(offsets, start, count + 1).astype(np.int64) if count else NO_CELLS
        counts = np.diff(ends)
        if ends.ndim != 1 or (counts < 0).any():
            raise FormatError(f"{offsets.name} must be ascending")
        yield counts
        start += count + 1
