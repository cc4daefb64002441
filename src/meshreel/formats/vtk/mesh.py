"""The contents of a VTK file at one time, and its surface."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.frames.field_tracks import (
    COLOR_NAMES,
    NORMALS,
    UV_NAMES,
    Field,
    Fields,
    Key,
    add_field,
)
from meshreel.formats.frames.frame import Frame
from meshreel.formats.notes import listed, note_kinds, note_left_out, note_normals
from meshreel.formats.surfaces.cells import Cells, CellSurface, extract_surface
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.sequence import Vertices
from meshreel.model.surface import MAX_COMPONENTS, VALUE_TYPES, Attribute, Domain, Kind, Surface

TEXTURE_COORDINATES = "TCoords"
UNSUPPORTED_ARRAYS = f"arrays of text, or with more than {MAX_COMPONENTS} components"
"""How notes name arrays that attributes cannot hold."""


@dataclass(frozen=True, eq=False)
class DataArray:
    """A VTK data array: values at the points or cells of a mesh.

    Parameters
    ----------
    name : str
    values : array of shape (N,) or (N, C)
    role : str, default ""
        The active attribute of VTK that it is: "TCoords", "Normals" or another.
    kind, unit : str, default ""
        Kind and unit that the file declares, for an attribute or a track.
    is_track : bool, default False
        Whether the file declares it a track, even if its values never change.
    """

    name: str
    values: npt.NDArray[Any]
    role: str = ""
    kind: str = ""
    unit: str = ""
    is_track: bool = False

    @property
    def is_declared_attribute(self) -> bool:
        """Whether it is an attribute rather than a track in a file with a single frame.

        True if the file declares it an attribute, or it is recognized as UV coordinates or colors.
        """
        has_attribute_kind = bool(self.kind) and not self.is_track
        return has_attribute_kind or kind_of(self) is not Kind.OTHER

    @property
    def field(self) -> Field:
        """Description of the array without its values."""
        width = math.prod(self.values.shape[1:])
        kind, unit = self.kind, self.unit
        return Field(self.values.dtype, width, self.role, kind, unit, self.is_track)


def surface_of_arrays(
    points: Iterable[DataArray],
    cells: Iterable[DataArray],
    n_points: int,
    n_cells: int,
    surface: CellSurface,
    notes: list[str],
) -> Surface:
    """Return a surface whose attributes are the given point and cell arrays.

    Normals, text and arrays with too many components are left out; the notes list them.

    Raises
    ------
    FormatError
        If an array does not have one value for each point or cell.
    """
    at_points = [(one, Domain.VERTEX, n_points, surface.kept) for one in points]
    at_cells = [(one, Domain.FACE, n_cells, surface.cells) for one in cells]
    found = [(one[0], _attribute(*one)) for one in at_points + at_cells]
    missing = [array for array, attribute in found if attribute is None]
    if any(array.role == NORMALS for array in missing):
        note_normals(notes)
    note_kinds(
        notes, UNSUPPORTED_ARRAYS, (array.name for array in missing if array.role != NORMALS)
    )
    return Surface(attributes=tuple(one for _, one in found if one is not None))


def _attribute(
    array: DataArray, domain: Domain, n_items: int, rows: npt.NDArray[np.int64] | slice
) -> Attribute | None:
    values = array.values
    if len(values) != n_items:
        raise FormatError(f"array {array.name!r} has {len(values)} values; expected {n_items}")
    values = values.reshape(n_items, -1)
    if array.role == NORMALS or values.dtype.kind not in "iuf" or values.shape[1] > MAX_COMPONENTS:
        return None
    values = _as_value_type(values[rows])
    return Attribute(array.name, kind_of(array), domain, values)


def _as_value_type(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Convert values to a type that attributes allow, without loss if one can represent them."""
    if values.dtype in VALUE_TYPES:
        return values
    if values.dtype.kind == "f":
        return values.astype(np.float32 if values.dtype.itemsize < 4 else np.float64)
    limits = np.iinfo(np.int32)
    is_small = values.size == 0 or (limits.min <= values.min() and values.max() <= limits.max)
    return values.astype(np.int32 if is_small else np.float64)


def kind_of(array: DataArray) -> Kind:
    """Return the kind of attribute that an array represents."""
    values, name = array.values, array.name.lower()
    width, is_float = math.prod(values.shape[1:]), values.dtype.kind == "f"
    is_uv = array.kind == Kind.UV or array.role == TEXTURE_COORDINATES
    if width == 2 and is_float and (is_uv or name in UV_NAMES):
        return Kind.UV
    is_color = array.kind == Kind.COLOR or name in COLOR_NAMES
    if width in (3, 4) and (values.dtype == np.uint8 or (is_float and is_color)):
        return Kind.COLOR
    return Kind.OTHER


@dataclass(frozen=True, eq=False)
class VtkMesh:
    """Points, cells and data arrays of a VTK file.

    Parameters
    ----------
    points : float array of shape (N, 3)
    cells : Cells
    point_data, cell_data : tuple of DataArray
        Arrays with a value for each point and each cell.
    left_out : tuple of str
        Descriptions of what else the file contains, for notes.
    """

    points: Vertices
    cells: Cells
    point_data: tuple[DataArray, ...] = ()
    cell_data: tuple[DataArray, ...] = ()
    left_out: tuple[str, ...] = ()

    @cached_property
    def cell_surface(self) -> CellSurface:
        """The polygons of the cells and the points and cells that they come from."""
        return extract_surface(self.cells, len(self.points))

    @property
    def polygons(self) -> PolygonMesh:
        """The surface of the cells: 2D cells, and the boundary of solid cells."""
        return self.cell_surface.mesh(self.points)

    def surface(self, notes: list[str]) -> Surface:
        """Return all data arrays as attributes; the notes list omitted data."""
        for what in self.left_out:
            note_left_out(notes, what)
        return surface_of_arrays(
            self.point_data,
            self.cell_data,
            len(self.points),
            len(self.cells.types),
            self.cell_surface,
            notes,
        )

    def values_on_surface(self, array: DataArray, domain: Domain) -> npt.NDArray[Any]:
        """Return the values of an array at the vertices or polygons of the surface.

        Raises
        ------
        FormatError
            If the array does not have one value for each point or cell.
        """
        n_items = len(self.points) if domain is Domain.VERTEX else len(self.cells.types)
        if len(array.values) != n_items:
            raise FormatError(
                f"array {array.name!r} has {len(array.values)} values; expected {n_items}"
            )
        return array.values[self.cell_surface.source_rows[domain]]

    def attribute_surface(self, notes: list[str]) -> Surface:
        """Return texture coordinates, colors and declared attributes; other arrays are tracks."""
        at_points, at_cells = (
            tuple(one for one in arrays if one.is_declared_attribute)
            for arrays in (self.point_data, self.cell_data)
        )
        return replace(self, point_data=at_points, cell_data=at_cells).surface(notes)

    def frame(self) -> Frame:
        """Return the mesh as a frame; raises as `fields`, or FormatError for damaged cells."""
        notes: list[str] = []
        surface = self.attribute_surface(notes)
        return Frame(self.polygons, surface, self.fields, notes)

    @property
    def fields(self) -> Fields:
        """All point and cell arrays on the surface.

        Raises
        ------
        InvalidInputError
            If two point arrays or two cell arrays share a name.
        FormatError
            If an array does not have one value for each point or cell.
        """
        known: dict[Key, Field] = {}
        found: dict[Key, tuple[npt.NDArray[Any], Field]] = {}
        sides = ((Domain.VERTEX, self.point_data), (Domain.FACE, self.cell_data))
        for domain, array in ((domain, one) for domain, arrays in sides for one in arrays):
            key, values = (domain, array.name), self.values_on_surface(array, domain)
            # Arrays that are not surface attributes are tracks, even if their values are constant.
            is_track = array.is_track or not array.is_declared_attribute
            field = replace(array.field, is_track=is_track)
            add_field(known, key, field)
            found[key] = values, field
        return found


def join_pieces(meshes: Sequence[VtkMesh]) -> VtkMesh:
    """Join the pieces of a file into one mesh; keeps the arrays that all pieces share."""
    if len(meshes) == 1:
        return meshes[0]
    for mesh in meshes:  # an invalid index would point into another piece after joining
        if ((mesh.cells.points < 0) | (mesh.cells.points >= len(mesh.points))).any():
            raise FormatError(f"a cell has a point index outside 0..{len(mesh.points) - 1}")
    starts = np.cumsum([0] + [len(mesh.points) for mesh in meshes])
    cells = Cells(
        np.concatenate([mesh.cells.types for mesh in meshes]),
        np.concatenate([mesh.cells.counts for mesh in meshes]),
        np.concatenate(
            [mesh.cells.points + start for mesh, start in zip(meshes, starts, strict=False)]
        ),
    )
    point_data = _join_data([mesh.point_data for mesh in meshes])
    cell_data = _join_data([mesh.cell_data for mesh in meshes])
    differing = _differing_arrays(meshes, [*point_data, *cell_data])
    return VtkMesh(
        np.concatenate([mesh.points for mesh in meshes]),
        cells,
        point_data,
        cell_data,
        (*dict.fromkeys(what for mesh in meshes for what in mesh.left_out), *differing),
    )


def _differing_arrays(meshes: Sequence[VtkMesh], kept: Sequence[DataArray]) -> Iterator[str]:
    """Describe the arrays that are not in all pieces, or differ in their components."""
    names = {one.name for mesh in meshes for one in (*mesh.point_data, *mesh.cell_data)}
    if missing := names - {one.name for one in kept}:
        yield f"arrays that differ between pieces: {listed(sorted(missing))}"


def _join_data(data: Sequence[tuple[DataArray, ...]]) -> tuple[DataArray, ...]:
    found = []
    for first in data[0]:
        same = [one for arrays in data for one in arrays if one.name == first.name]
        if len(same) == len(data) and len({one.values.shape[1:] for one in same}) == 1:
            values = np.concatenate([one.values for one in same])
            found.append(replace(first, values=values))
    return tuple(found)
