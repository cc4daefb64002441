"""The contents of a VTK file at one time, and its surface."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.frames.field_tracks import (
    Field,
    Fields,
    Key,
    add_field,
)
from meshreel.formats.notes import listed, note_left_out
from meshreel.formats.surfaces.cells import Cells, CellSurface, extract_surface
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.formats.vtk.data_arrays import DataArray, surface_of_arrays
from meshreel.model.sequence import Vertices
from meshreel.model.surface import Domain, Surface


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
