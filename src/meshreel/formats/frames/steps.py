"""Meshes of VTK cells at one or several time steps, as frames, surfaces and tracks.

Floating-point results are tracks, and so are other arrays that change; the rest are attributes.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values
from meshreel.errors import FormatError
from meshreel.formats.frames.field_tracks import (
    NORMALS,
    Field,
    Key,
    add_field,
    attribute_kind,
    field_tracks,
)
from meshreel.formats.frames.frame import Frame
from meshreel.formats.frames.stored_frames import checksum
from meshreel.formats.surfaces.cells import Cells, CellSurface, cell_mesh
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.notes import NoteKind, Notes, note_normals
from meshreel.model.sequence import Vertices
from meshreel.model.surface import (
    MAX_COMPONENTS,
    VALUE_TYPES,
    Attribute,
    Domain,
    FaceGroups,
    Int32s,
    Kind,
    Surface,
)
from meshreel.model.tracks import TrackSource
from meshreel.runtime.counting import counted

UNSUPPORTED_ARRAYS = f"arrays of text, or with more than {MAX_COMPONENTS} components"
"""How notes name arrays that attributes cannot hold."""

PARTIAL = "values of pieces that lack an array, NaN there"
"""How notes name arrays that only some pieces have."""

GHOSTS, DUPLICATE = (Domain.FACE, "vtkGhostType"), 1
"""The array that flags cells, and its flag of cells that another piece contains."""

LeftOut = Sequence[tuple[str, str]]
"""Contents that are left out, for notes: a subject, such as "field data", and a name."""


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
    describe: Callable[[], Field]
    """Returns the description; raises FormatError if the array cannot be read."""
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
    is_text = values.dtype.kind == "O"
    return DataArray(
        domain,
        name,
        lambda: values,
        cache(lambda: tuple(values.ravel()) if is_text else checksum(values)),
        lambda: field,
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
    left_out: LeftOut = ()
    """What else the file contains, for notes."""
    time_s: float | None = None
    """Time that the file states, in seconds."""

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

    def note_left_out(self, notes: Notes) -> None:
        """Note what the file contains besides the mesh and its data."""
        notes.left_out_items(self.left_out)

    def share_data(self, previous: "Step") -> "Step":
        """Return the step with arrays of another one where they are equal."""

        def contents(array: DataArray) -> object:
            description = tuple(vars(array.describe()).values())
            return array.domain, array.name, array.identify(), description

        arrays = {contents(array): array for array in previous.data}
        return replace(self, data=[arrays.get(contents(array), array) for array in self.data])

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
        """Return a surface whose attributes are the given arrays; text of cells becomes groups.

        Normals, other text and arrays with too many components are left out; the notes list them.
        """
        attributes, groups, unsupported, has_normals = [], [], [], False
        for domain in self.sizes:
            for array in (array for array in arrays if array.domain is domain):
                values, field = self.values(array), array.describe()
                if field.role == NORMALS:
                    has_normals = True
                elif _is_text_of_cells(array.domain, values):
                    group, cell_numbers = self._groups(array.name, array.read())
                    groups.append(group)
                    attributes += cell_numbers
                elif values.dtype.kind not in "iuf" or values.shape[1] > MAX_COMPONENTS:
                    unsupported.append(array.name)
                else:
                    kind = attribute_kind(array.name, field, values.dtype)
                    attributes.append(Attribute(array.name, kind, domain, _as_value_type(values)))
        if has_normals:
            note_normals(notes)
        notes.left_out(UNSUPPORTED_ARRAYS, unsupported)
        return Surface(attributes=tuple(attributes), groups=tuple(groups))

    def _groups(self, name: str, texts: npt.NDArray[Any]) -> tuple[FaceGroups, list[Attribute]]:
        """Return the faces grouped by the text of their cells, and its numbers at kept cells."""
        labels, rows_of_labels = np.unique(texts.ravel(), return_inverse=True)
        numbers: Int32s = rows_of_labels.astype(np.int32) - bool(labels[0] == "")  # "" is no group
        groups = FaceGroups(name, tuple(filter(None, labels.tolist())), numbers[self.surface.cells])
        if self.surface.volume is None:
            return groups, []
        rows = self.surface.source_rows[Domain.CELL]
        return groups, [Attribute(name, Kind.OTHER, Domain.CELL, numbers[rows, None])]

    def frame(self) -> Frame:
        """Return the step as the only one of its file.

        UV coordinates, colors and declared attributes are attributes, other arrays are tracks.

        Raises
        ------
        FormatError
            If an array does not have one value for each point or cell.
        """
        notes = Notes()
        self.note_left_out(notes)
        self.surface.note_interior(notes)
        fields: dict[Key, tuple[Values, Field]] = {}
        attributes = []
        for array in self.arrays:
            values, field = self.values(array), array.describe()
            if _is_text_of_cells(array.domain, values):
                attributes.append(array)
                continue
            kind = attribute_kind(array.name, field, values.dtype)
            is_attribute = array.is_attribute or kind is not Kind.OTHER
            if is_attribute:
                attributes.append(array)
            is_track = field.is_track or not is_attribute
            fields[array.key] = values, replace(field, is_track=is_track)
        surface = self.attributes(attributes, notes)
        return Frame(self.mesh, surface, fields, notes, time_s=self.time_s)


def note_unreadable(key: Key, error: FormatError, notes: Notes) -> None:
    """Note that an array is left out because it cannot be read, once for each array."""
    subject = f"arrays that cannot be read: {key[1]}"
    if not any(note.subject == subject for note in notes):
        notes.add(NoteKind.LEFT_OUT, subject, f"left out: array {key[1]!r}, which {error}")


def _is_text_of_cells(domain: Domain, values: npt.NDArray[Any]) -> bool:
    is_single_text = values.dtype.kind in "UO" and values[:1].size == len(values[:1])
    return is_single_text and domain is not Domain.VERTEX


def _as_value_type(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Convert values to a type that attributes allow, without loss if one can represent them."""
    if values.dtype in VALUE_TYPES:
        return values
    if values.dtype.kind == "f":
        return values.astype(np.float32 if values.dtype.itemsize < 4 else np.float64)
    return values.astype(np.int32)


def _is_track(array: DataArray, field: Field) -> bool:
    """Whether an array is a track even if it never changes.

    It is if the file declares so, or if its values are real numbers, or integers that attributes
    cannot hold.
    """
    if array.is_track or array.is_attribute or field.role == NORMALS:
        return array.is_track
    if field.dtype.kind in "iu":
        if field.dtype.itemsize < 4 or not (values := array.read()).size:
            return False
        limits = np.iinfo(np.int32)
        return bool(values.min() < limits.min or values.max() > limits.max)
    is_other = attribute_kind(array.name, field, field.dtype) is Kind.OTHER
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
        self._are_tracks: dict[object, bool] = {}
        self._track_keys: set[Key] = set()
        self._attribute_keys: set[Key] = set()

    def frame(self, index: int) -> PolygonMesh:
        """Return the surface of a step, whose arrays are compared with those of other frames."""
        step = self._read(index)
        step.note_left_out(self._notes)
        identities: dict[Key, list[object]] = {}
        fields: list[tuple[Key, Field]] = []
        for array in step.arrays:
            try:
                field, identity = array.describe(), (array.key, array.identify())
                if identity not in self._are_tracks:
                    self._are_tracks[identity] = _is_track(array, field)
            except FormatError as error:
                note_unreadable(array.key, error, self._notes)
                continue
            identities.setdefault(array.key, []).append(identity)
            fields.append((array.key, field))
            self._track_keys |= {array.key} if self._are_tracks[identity] else set()
            self._attribute_keys |= {array.key} if array.is_attribute else set()
        self._identities[index], self._fields[index] = identities, fields
        return step.mesh

    def surface(self, index: int) -> Surface:
        """Return the arrays of a step that are the same in all frames read so far."""
        step = self._read(index)
        step.surface.note_interior(self._notes)
        constant_keys = self._identities[index].keys() - self._changing_keys()
        constant = [array for array in step.arrays if array.key in constant_keys]
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

    def without_points(self) -> "Piece":
        """Return the piece without its points, whose indices in cells stay the same."""
        arrays = (
            _with_values(each, each.read()[: 0 if each.domain is Domain.VERTEX else None])
            for each in self.arrays
        )
        return Piece(self.points[:0], self.cells, tuple(arrays))

    def without_ghosts(self) -> "Piece":
        """Return the piece without the cells that other pieces contain too."""
        flags = next((array for array in self.arrays if array.key == GHOSTS), None)
        if flags is None:
            return self
        is_kept, cells = flags.read().ravel() & DUPLICATE == 0, self.cells
        corners = cells.points[np.repeat(is_kept, cells.counts)]
        cells = Cells(cells.types[is_kept], cells.counts[is_kept], corners)
        rows = {Domain.VERTEX: slice(None), Domain.FACE: is_kept}
        arrays = (_with_values(each, each.read()[rows[each.domain]]) for each in self.arrays)
        return Piece(self.points, cells, tuple(arrays))

    def step(self, left_out: LeftOut, time_s: float | None = None) -> Step:
        """Return the mesh with its surface; the parameters are those of `Step`.

        Raises
        ------
        InvalidInputError
            If two arrays of points or of cells share a name.
        FormatError
            If a cell is damaged, or there is no surface.
        """
        fields: dict[Key, Field] = {}
        for array in self.arrays:
            add_field(fields, array.key, array.describe())
        points, n_cells = self.points, len(self.cells.types)
        surface = cell_mesh(self.cells, len(points))
        return Step(len(points), n_cells, surface, lambda: points, self.arrays, left_out, time_s)


def join_pieces(
    pieces: Sequence[Piece], *, same_points: bool = False
) -> tuple[Piece, list[tuple[str, str]]]:
    """Return the joined pieces, and the contents that are left out.

    Floating-point arrays are NaN in pieces without them; other arrays that differ are left out.

    Parameters
    ----------
    same_points : bool, default False
        Whether all pieces have the same points, with the same values.
    """
    pieces = [piece for piece in pieces if len(piece.points)] or pieces[:1]
    if len(pieces) == 1:
        return pieces[0], []
    n_cells = sum(len(piece.cells.types) for piece in pieces)
    pieces = [piece.without_ghosts() for piece in pieces]
    starts = np.cumsum([0] + [len(piece.points) for piece in pieces])
    cells = Cells.join(
        piece.cells.shifted(0 if same_points else start, len(piece.points))
        for piece, start in zip(pieces, starts, strict=False)
    )
    if same_points:
        pieces[1:] = [piece.without_points() for piece in pieces[1:]]
    counts = Counter(array.key for piece in pieces for array in piece.arrays)
    arrays = tuple(array for key in counts for array in _join_arrays(key, pieces))
    joined = {array.key for array in arrays}
    left_out = [
        (PARTIAL if key in joined else "arrays that differ between pieces", key[1])
        for key, count in sorted(counts.items())
        if key not in joined or count < len(pieces)
    ]
    points = np.concatenate([piece.points for piece in pieces])
    if n_ghosts := n_cells - len(cells.types):
        left_out.append(("cells", f"{counted(n_ghosts, 'ghost')} that other pieces contain"))
        arrays = tuple(array for array in arrays if array.key != GHOSTS or array.read().any())
    return Piece(points, cells, arrays), left_out


def _join_arrays(key: Key, pieces: Sequence[Piece]) -> Iterator[DataArray]:
    """Yield the joined array of a key, unless the arrays differ."""
    parts = [next((array for array in piece.arrays if array.key == key), None) for piece in pieces]
    first, *others = (part for part in parts if part is not None)
    shape, n_missing = first.read().shape[1:], parts.count(None)
    is_float = first.describe().dtype.kind == "f"
    if all(other.read().shape[1:] == shape for other in others) and (is_float or not n_missing):
        at_points = key[0] is Domain.VERTEX
        sizes = [len(piece.points if at_points else piece.cells.types) for piece in pieces]
        missing = (np.full((size, *shape), np.nan, np.float32) for size in sizes)
        values = [part.read() if part else nan for part, nan in zip(parts, missing, strict=True)]
        yield _with_values(first, np.concatenate(values))


def _with_values(array: DataArray, values: npt.NDArray[Any]) -> DataArray:
    """Return a data array with other values."""
    field = array.describe()
    return loaded_array(
        *array.key, values, field.role, field.kind, field.unit, is_track=field.is_track
    )
