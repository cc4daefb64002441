"""Meshes of VTK cells at one or several time steps, as frames, surfaces and tracks.

Floating-point results are tracks, and so are other arrays that change; the rest are attributes.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values
from meshreel.errors import FormatError
from meshreel.formats.frames.field_tracks import (
    COLOR_NAMES,
    NORMALS,
    UV_NAMES,
    Field,
    Key,
    add_field,
    field_tracks,
)
from meshreel.formats.frames.frame import Frame
from meshreel.formats.frames.stored_frames import checksum
from meshreel.formats.surfaces.cells import Cells, CellSurface, cell_mesh
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.notes import Notes, listed, note_normals
from meshreel.model.sequence import Vertices
from meshreel.model.surface import MAX_COMPONENTS, VALUE_TYPES, Attribute, Domain, Kind, Surface
from meshreel.model.tracks import TrackSource

TEXTURE_COORDINATES = "TCoords"
UNSUPPORTED_ARRAYS = f"arrays of text, or with more than {MAX_COMPONENTS} components"
"""How notes name arrays that attributes cannot hold."""

TIMES = ("TimeValue", "TIME", "CYCLE")
"""Field data with the time of a file; not reported as left out."""


@dataclass(frozen=True, eq=False)
class DataArray:
    """An array with values at all points or cells of a step, which is read on demand."""

    domain: Domain
    """Vertices for points, faces for cells."""
    name: str
    read: Callable[[], npt.NDArray[Any]]
    """Returns the values, of shape (N,) or (N, C)."""
    identify: Callable[[], object]
    """Returns a key that is equal in two steps if the values are equal."""
    describe: Callable[[], Field | None]
    """Returns the description, or None if the array cannot be a track."""
    role: str = ""
    """The active attribute of VTK that it is: "TCoords", "Normals" or another."""
    kind: str = ""
    """Kind that the file declares, for an attribute or a track."""
    is_track: bool = False
    """Whether the file declares it a track, even if it never changes."""
    is_attribute: bool = False
    """Whether the file declares it an attribute, which changes only with the faces."""

    @property
    def key(self) -> Key:
        """Domain and name."""
        return self.domain, self.name


def loaded_array(
    domain: Domain,
    name: str,
    values: npt.NDArray[Any],
    role: str = "",
    kind: str = "",
    unit: str = "",
    *,
    is_track: bool = False,
) -> DataArray:
    """Return a data array whose values are in memory."""
    field = Field(values.dtype, math.prod(values.shape[1:]), role, kind, unit, is_track)
    return DataArray(
        domain,
        name,
        lambda: values,
        cache(partial(checksum, values)),
        lambda: field,
        role,
        kind,
        is_track,
        bool(kind) and not is_track,
    )


@dataclass(frozen=True, eq=False)
class Step:
    """The mesh of a step."""

    n_points: int
    n_cells: int
    surface: CellSurface
    """Of its cells."""
    read_points: Callable[[], Vertices]
    """Reads the points."""
    data: Sequence[DataArray]
    """Arrays of vertices, and those of cells with the domain of faces."""
    left_out: tuple[str, ...] = ()
    """Descriptions of what else the file contains, for notes."""

    @cached_property
    def arrays(self) -> list[DataArray]:
        """The arrays of points, and those of cells, which belong to faces if cells are not kept."""
        domain = self.surface.cell_domain
        return [
            array if array.domain is Domain.VERTEX else replace(array, domain=domain)
            for array in self.data
        ]

    @property
    def mesh(self) -> PolygonMesh:
        """The surface of the cells: 2D cells, and the boundary of solid cells."""
        return self.surface.mesh(self.read_points())

    def share_data(self, previous: "Step") -> "Step":
        """Return the step with surface and arrays of another one where they are equal."""
        surface = previous.surface if previous.surface.equals(self.surface) else self.surface
        arrays = {_contents(array): array for array in previous.data}
        data = [arrays.get(_contents(array), array) for array in self.data]
        return replace(self, surface=surface, data=data)

    @property
    def sizes(self) -> dict[Domain, int]:
        """Number of points and cells."""
        return {Domain.VERTEX: self.n_points, self.surface.cell_domain: self.n_cells}

    def values(self, array: DataArray) -> npt.NDArray[Any]:
        """Read the values of an array at the vertices or faces of the surface, of shape (N, C).

        Raises
        ------
        FormatError
            If the array does not have one value for each point or cell.
        """
        values, n_items = array.read(), self.sizes[array.domain]
        if len(values) != n_items:
            raise FormatError(f"array {array.name!r} has {len(values)} values; expected {n_items}")
        return values.reshape(n_items, -1)[self.surface.source_rows[array.domain]]

    def attributes(self, arrays: Iterable[DataArray], notes: Notes) -> Surface:
        """Return a surface whose attributes are the given arrays.

        Normals, text and arrays with too many components are left out; the notes list them.
        """
        attributes, unsupported, has_normals = [], [], False
        for domain in self.sizes:
            for array in (array for array in arrays if array.domain is domain):
                values = self.values(array)
                if array.role == NORMALS:
                    has_normals = True
                elif values.dtype.kind not in "iuf" or values.shape[1] > MAX_COMPONENTS:
                    unsupported.append(array.name)
                else:
                    kind = _attribute_kind(array, values.dtype, values.shape[1])
                    attributes.append(Attribute(array.name, kind, domain, _as_value_type(values)))
        if has_normals:
            note_normals(notes)
        notes.left_out(UNSUPPORTED_ARRAYS, unsupported)
        return Surface(attributes=tuple(attributes))

    def frame(self) -> Frame:
        """Return the step as the only one of its file.

        UV coordinates, colors and declared attributes are attributes, other arrays are tracks.

        Raises
        ------
        FormatError
            If an array does not have one value for each point or cell.
        """
        notes = Notes()
        for contents in self.left_out:
            notes.left_out(contents)
        self.surface.note_interior(notes)
        fields: dict[Key, tuple[Values, Field]] = {}
        attributes = []
        for array in self.arrays:
            values, field = self.values(array), array.describe()
            assert field is not None
            kind = _attribute_kind(array, values.dtype, values.shape[1])
            is_attribute = array.is_attribute or kind is not Kind.OTHER
            if is_attribute:
                attributes.append(array)
            is_track = field.is_track or not is_attribute
            fields[array.key] = values, replace(field, is_track=is_track)
        surface = self.attributes(attributes, notes)
        return Frame(self.mesh, surface, fields, notes)


def _contents(array: DataArray) -> object:
    """Return a key that is equal for arrays with the same description and values."""
    field = array.describe()
    field_values = None if field is None else tuple(vars(field).values())
    return array.domain, array.name, array.identify(), field_values


def _as_value_type(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Convert values to a type that attributes allow, without loss if one can represent them."""
    if values.dtype in VALUE_TYPES:
        return values
    if values.dtype.kind == "f":
        return values.astype(np.float32 if values.dtype.itemsize < 4 else np.float64)
    limits = np.iinfo(np.int32)
    is_small = values.size == 0 or (limits.min <= values.min() and values.max() <= limits.max)
    return values.astype(np.int32 if is_small else np.float64)


def _attribute_kind(array: DataArray, dtype: np.dtype[Any], width: int) -> Kind:
    """Return the kind of attribute that an array represents, given its numbers per value."""
    name, is_float = array.name.lower(), dtype.kind == "f"
    is_uv = array.kind == Kind.UV or array.role == TEXTURE_COORDINATES
    if width == 2 and is_float and (is_uv or name in UV_NAMES):
        return Kind.UV
    is_color = array.kind == Kind.COLOR or name in COLOR_NAMES
    if width in (3, 4) and (dtype == np.uint8 or (is_float and is_color)):
        return Kind.COLOR
    return Kind.OTHER


def _is_track(array: DataArray, field: Field | None) -> bool:
    """Whether an array is a track even if it never changes: declared as such, or real numbers."""
    if array.is_track or array.is_attribute or field is None or array.role == NORMALS:
        return array.is_track
    is_other = _attribute_kind(array, field.dtype, field.n_columns) is Kind.OTHER
    return field.dtype.kind == "f" and is_other


class StepFrames:
    """Frames, surfaces and tracks of a `SceneMesh` whose steps are read on demand.

    Parameters
    ----------
    read : function of a step number
    notes : Notes
        Receives a sentence for each thing that is left out.
    """

    def __init__(self, read: Callable[[int], Step], notes: Notes) -> None:
        self._read, self._notes = read, notes
        self._identities: dict[int, dict[Key, list[object]]] = {}
        self._fields: dict[int, list[tuple[Key, Field]]] = {}
        self._track_keys: set[Key] = set()
        self._attribute_keys: set[Key] = set()

    def frame(self, index: int) -> PolygonMesh:
        """Return the surface of a step, whose arrays are compared with those of other frames."""
        step = self._read(index)
        identities: dict[Key, list[object]] = {}
        fields: list[tuple[Key, Field]] = []
        for array in step.arrays:
            identities.setdefault(array.key, []).append(array.identify())
            if (field := array.describe()) is not None:
                fields.append((array.key, field))
            self._track_keys |= {array.key} if _is_track(array, field) else set()
            self._attribute_keys |= {array.key} if array.is_attribute else set()
        self._identities[index], self._fields[index] = identities, fields
        return step.mesh

    def surface(self, index: int) -> Surface:
        """Return the arrays of a step that are the same in all frames read so far."""
        step = self._read(index)
        step.surface.note_interior(self._notes)
        changing_keys = self._changing_keys()
        constant = [array for array in step.arrays if array.key not in changing_keys]
        return step.attributes(constant, self._notes)

    def tracks(self, frames: range) -> Mapping[str, TrackSource]:
        """Return the other arrays as tracks of consecutive steps that share their faces."""
        changing_keys = self._changing_keys()
        frame_fields: list[dict[Key, Field]] = [{} for _ in frames]
        for fields, index in zip(frame_fields, frames, strict=True):
            for key, field in self._fields[index]:
                if key in changing_keys:
                    add_field(fields, key, field)

        def read(index: int, key: Key) -> Values:
            step = self._read(frames[index])
            array = next(array for array in step.arrays if array.key == key)
            return step.values(array)

        step = self._read(frames.start)
        n_verts = step.surface.n_verts(step.n_points)
        sizes = {Domain.VERTEX: n_verts, step.surface.cell_domain: step.surface.n_cell_items}
        return field_tracks(frame_fields, sizes, read, self._notes)

    def _changing_keys(self) -> set[Key]:
        """Arrays that differ or are missing in some frames read so far, or are always tracks."""
        steps = list(self._identities.values())
        keys = {key for step in steps for key in step}
        differing_keys = {
            key for key in keys if any(step.get(key) != steps[0].get(key) for step in steps)
        }
        return self._track_keys | (differing_keys - self._attribute_keys)


@dataclass(frozen=True, eq=False)
class Piece:
    """Points, cells and loaded data arrays of a file, or of a part of it."""

    points: Vertices
    """float array of shape (N, 3)."""
    cells: Cells
    arrays: tuple[DataArray, ...] = ()

    def step(self, left_out: Iterable[str] = ()) -> Step:
        """Return the mesh with its surface; `left_out` is that of `Step`.

        Raises
        ------
        InvalidInputError
            If two arrays of points or of cells share a name.
        FormatError
            If a cell is damaged, or there is no surface.
        """
        fields: dict[Key, Field] = {}
        for array in self.arrays:
            if (field := array.describe()) is not None:
                add_field(fields, array.key, field)
        points, n_cells = self.points, len(self.cells.types)
        surface = cell_mesh(self.cells, len(points))
        return Step(len(points), n_cells, surface, lambda: points, self.arrays, tuple(left_out))


def join_pieces(pieces: Sequence[Piece]) -> tuple[Piece, tuple[str, ...]]:
    """Join pieces; keep the arrays that all share, and describe the others for notes."""
    if len(pieces) == 1:
        return pieces[0], ()
    starts = np.cumsum([0] + [len(piece.points) for piece in pieces])
    cells = Cells.join(
        piece.cells.shifted(start, len(piece.points))
        for piece, start in zip(pieces, starts, strict=False)
    )
    arrays = tuple(_join_arrays(pieces))
    missing = {array.name for piece in pieces for array in piece.arrays}
    missing -= {array.name for array in arrays}
    left_out = (f"arrays that differ between pieces: {listed(sorted(missing))}",) if missing else ()
    return Piece(np.concatenate([piece.points for piece in pieces]), cells, arrays), left_out


def _join_arrays(pieces: Sequence[Piece]) -> Iterator[DataArray]:
    for first in pieces[0].arrays:
        matches = [array for piece in pieces for array in piece.arrays if array.key == first.key]
        values = [array.read() for array in matches]
        if len(matches) == len(pieces) and len({value.shape[1:] for value in values}) == 1:
            field = first.describe()
            assert field is not None
            joined = np.concatenate(values)
            yield loaded_array(
                *first.key, joined, field.role, field.kind, field.unit, is_track=field.is_track
            )
