"""The time steps of a mesh in a VTKHDF file."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.arrays.named_tracks import array_name
from meshreel.formats.frames.field_tracks import Field, Key, add_field, field_tracks
from meshreel.formats.frames.stored_tracks import StoredTrack
from meshreel.formats.hdf.described_tracks import said_of, unit_of
from meshreel.formats.hdf.reading import (
    Dataset,
    Node,
    find_dataset,
    find_group,
    hdf_errors,
    read_all,
    read_rows,
    require_dataset,
)
from meshreel.formats.notes import note_kinds, note_left_out
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.formats.vtk.cells import (
    POLY_LINE,
    POLY_VERTEX,
    POLYGON,
    STRIP,
    Cells,
    CellSurface,
    find_surface,
)
from meshreel.formats.vtk.data_arrays import UNFIT, DataArray, surface_of_arrays
from meshreel.formats.vtk.vtkhdf_cells import count_before, integers, read_cells
from meshreel.model.surface import Domain, Surface
from meshreel.runtime.counting import counted

Int64s = npt.NDArray[np.int64]

DATA = {"PointData": Domain.VERTEX, "CellData": Domain.FACE}
PLACES = {domain: place for place, domain in DATA.items()}

POLY_DATA_GROUPS: dict[str, int | None] = {
    "Vertices": POLY_VERTEX,
    "Lines": POLY_LINE,
    "Polygons": POLYGON,
    "Strips": STRIP,
}
"""In the order in which steps list them."""


class VtkSteps:
    """The frames of a group of type PolyData or UnstructuredGrid.

    Parameters
    ----------
    group : h5py group
    is_poly_data : bool
        Or else an unstructured grid.
    notes : list of str
        Gains a sentence on what is left out.

    Raises
    ------
    FormatError
        If a dataset that is needed is missing, or steps do not agree.
    """

    def __init__(self, group: Node, *, is_poly_data: bool, notes: list[str]) -> None:
        self._group, self._notes = group, notes
        self._steps = find_group(group, "Steps")
        self._points = require_dataset(group, "Points")
        if len(self._points.shape) != 2 or self._points.shape[1] != 3:
            raise FormatError(f"Points must have shape (N, 3); got {self._points.shape}")
        if self._points.dtype.kind != "f" or self._points.dtype.itemsize not in (4, 8):
            raise FormatError(f"Points must be float32 or float64; got {self._points.dtype}")
        self._kinds = POLY_DATA_GROUPS if is_poly_data else {"": None}
        self._n_points = integers(require_dataset(group, "NumberOfPoints"))
        self.times_s = self._read_basis()
        self._first_part = self._per_step("PartOffsets")
        all_parts = len(self._n_points) if self._steps is None else 1
        self._n_parts = self._per_step("NumberOfParts", default=all_parts)
        self._point_starts = self._per_step("PointOffsets")
        self._cell_starts = self._per_step("CellOffsets", len(self._kinds))
        self._corner_starts = self._per_step("ConnectivityIdOffsets", len(self._kinds))
        self._cells_before: dict[str, Int64s] = {}
        self._cached: tuple[bytes, Cells, CellSurface] | None = None

    def frame(self, index: int) -> PolygonMesh:
        """The surface of a step."""
        _, surface = self._surface(index)
        n_points = self._points_of(index)
        return surface.mesh(read_rows(self._points, int(self._point_starts[index, 0]), n_points))

    def surface(self, index: int) -> Surface:
        """The attributes of a step that are the same in all."""
        cells, surface = self._surface(index)
        counts = self._points_of(index), len(cells.types)
        at_points, at_cells = (
            [
                DataArray(one.name, read_rows(one.dataset, int(one.starts[index]), n), one.role)
                for one in self._stored_arrays(place)
                if not one.is_track
            ]
            for place, n in zip(DATA, counts, strict=True)
        )
        self._note_field_data()
        return surface_of_arrays(at_points, at_cells, *counts, surface, self._notes)

    def tracks(self, frames: range) -> dict[str, StoredTrack]:
        """What changes over time in some steps, whose cells are the same."""
        cells, surface = self._surface(frames.start)
        counts = dict(zip(DATA, (self._points_of(frames.start), len(cells.types)), strict=True))
        arrays: dict[Key, StepArray] = {}
        fields: dict[Key, Field] = {}
        for place, domain in DATA.items():
            for one in self._stored_arrays(place):
                if one.is_track and self._fits(one, frames, counts[place]):
                    key = domain, said_of(one.dataset, "name") or one.name
                    add_field(fields, key, one.field)
                    arrays[key] = one

        def read(index: int, key: Key) -> npt.NDArray[Any]:
            step, domain = frames[index], key[0]
            with hdf_errors():
                cells, surface = self._surface(step)
                is_at_points = domain is Domain.VERTEX
                count = self._points_of(step) if is_at_points else len(cells.types)
                rows = read_rows(arrays[key].dataset, int(arrays[key].starts[step]), count)
                return rows[surface.taken[domain]]

        n_verts = surface.n_verts(counts["PointData"])
        sizes = {Domain.VERTEX: n_verts, Domain.FACE: len(surface.cells)}
        return field_tracks([fields] * len(frames), sizes, read, self._notes)

    def _fits(self, one: "StepArray", frames: range, count: int) -> bool:
        """Whether an array has the rows of each of some steps; a note says if not."""
        starts, n_rows = one.starts[frames.start : frames.stop], len(one.dataset)
        bad = np.flatnonzero((starts < 0) | (starts + count > n_rows))
        if len(bad):
            step = int(bad[0])
            note_left_out(
                self._notes,
                f"arrays: {one.name} of {counted(n_rows, 'row')}; step {frames[step]} needs "
                f"{count} from row {starts[step]} on",
            )
        return len(bad) == 0

    def note_data_besides(self, surface: Surface) -> None:
        """Add to the notes what the group holds beside a surface, which stands elsewhere."""
        self._note_field_data()
        names = {one.name for one in surface.attributes} | {one.name for one in surface.groups}
        known = {array_name(name) for name in names}
        data = [one.name for name in DATA for one in self._stored_arrays(name) if not one.is_track]
        # The writer adds low lines to the second of two with one name.
        others = [one for one in data if one not in known and one.rstrip("_") not in known]
        note_kinds(self._notes, "data that another program added", others)

    def _note_field_data(self) -> None:
        note_kinds(self._notes, "field data", find_group(self._group, "FieldData") or ())

    def _read_basis(self) -> npt.NDArray[np.float64]:
        if self._steps is None:
            return np.zeros(1)
        times: npt.NDArray[np.float64] = (
            read_all(require_dataset(self._steps, "Values")).ravel().astype(np.float64)
        )
        n_steps: Any = np.ravel(self._steps.attrs.get("NSteps", len(times)))
        if len(times) == 0 or n_steps.tolist() != [len(times)]:
            raise FormatError(f"declares {n_steps.tolist()} steps; {len(times)} times are there")
        if not np.isfinite(times).all() or (np.diff(times) <= 0).any():
            raise FormatError("times of steps do not ascend; the file is damaged")
        return times

    def _per_step(self, name: str, width: int = 1, default: int = 0) -> Int64s:
        """Numbers of each step, of shape (T, width)."""
        shape = len(self.times_s), width
        dataset = find_dataset(self._steps, name) if self._steps is not None else None
        if dataset is None:
            return np.full(shape, default, np.int64)
        values = integers(dataset)
        if values.size != shape[0] * width or values.min() < 0:
            raise FormatError(f"Steps/{name} must be {shape} and not negative; got {values.shape}")
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
        """Points of a step, which Points has rows for."""
        start = int(self._point_starts[index, 0])
        count = int(sum(self._n_points[self._parts(index)].tolist()))
        if start + count > len(self._points) or count < 0:
            raise FormatError(
                f"Points has {counted(len(self._points), 'row')}; step {index} has {count} "
                f"from row {start} on"
            )
        return count

    def _surface(self, index: int) -> tuple[Cells, CellSurface]:
        """The cells of a step and their surface; those of the step before are kept."""
        parts = self._parts(index)
        place = np.concatenate(
            [[parts.start, parts.stop], self._cell_starts[index], self._corner_starts[index]]
        ).tobytes()
        if self._cached is None or self._cached[0] != place:
            cells = self._cells(index, parts)
            self._cached = place, cells, find_surface(cells, self._points_of(index))
        return self._cached[1:]

    def _cells(self, index: int, parts: slice) -> Cells:
        found = []
        for column, (name, kind) in enumerate(self._kinds.items()):
            group = find_group(self._group, name) if name else self._group
            starts = int(self._cell_starts[index, column]), int(self._corner_starts[index, column])
            if group is None:
                continue
            if name not in self._cells_before:
                self._cells_before[name] = count_before(group)
            points, before = self._n_points[parts], self._cells_before[name]
            found.append(read_cells(group, kind, parts, points, *starts, before))
        if not found:
            raise FormatError(f"{self._group.name} has none of {', '.join(self._kinds)}")
        return Cells(
            np.concatenate([one.types for one in found]),
            np.concatenate([one.counts for one in found]),
            np.concatenate([one.points for one in found]),
        )

    def _stored_arrays(self, place: str) -> Iterator["StepArray"]:
        """Arrays of numbers at points or cells; the notes name others."""
        group = find_group(self._group, place)
        n_steps = len(self.times_s)
        for name in group if group is not None else ():
            dataset = find_dataset(group, name)
            if dataset is None or dataset.dtype.kind not in "iuf" or not dataset.shape:
                note_kinds(self._notes, UNFIT, [name])
                continue
            offsets_name = f"Steps/{place}Offsets/{name}"
            found = find_dataset(self._group, offsets_name)
            is_at_points = place == "PointData"
            starts = self._point_starts[:, 0] if is_at_points else self._cell_starts.sum(axis=1)
            starts = starts if found is None else integers(found).ravel()
            if len(starts) != n_steps:
                raise FormatError(f"{offsets_name} has {len(starts)} numbers")
            yield StepArray(name, dataset, starts)


@dataclass(frozen=True, eq=False)
class StepArray:
    """Values at the points or cells of all steps, one after the other.

    Parameters
    ----------
    name : str
    dataset : Dataset
        Of numbers.
    starts : int64 array of shape (T,)
        The first row of each step.
    """

    name: str
    dataset: Dataset
    starts: Int64s

    @property
    def is_track(self) -> bool:
        """Whether it changes over time, or was written as what does."""
        is_written_so = said_of(self.dataset, "domain") in set(Domain)
        return is_written_so or bool((self.starts != self.starts[0]).any())

    @property
    def role(self) -> str:
        """What it is active as."""
        return said_of(self.dataset, "Attribute")

    @property
    def field(self) -> Field:
        """What is known of it without its numbers."""
        return Field(
            self.dataset.dtype.newbyteorder("="),
            math.prod(self.dataset.shape[1:]),
            self.role,
            said_of(self.dataset, "kind"),
            unit_of(self.dataset),
        )
