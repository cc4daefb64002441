"""The contents of a file of VTK at one time, and the polygons that it shows."""

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
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.formats.vtk.cells import Cells, CellSurface, find_surface
from meshreel.formats.vtk.data_arrays import DataArray, surface_of_arrays
from meshreel.model.sequence import Vertices
from meshreel.model.surface import Domain, Surface


@dataclass(frozen=True, eq=False)
class VtkMesh:
    """Points, cells and data arrays of a file.

    Parameters
    ----------
    points : float array of shape (N, 3)
    cells : Cells
    point_data, cell_data : tuple of DataArray
        Of all points and all cells.
    left_out : tuple of str
        What else the file holds, in words.
    """

    points: Vertices
    cells: Cells
    point_data: tuple[DataArray, ...] = ()
    cell_data: tuple[DataArray, ...] = ()
    left_out: tuple[str, ...] = ()

    @cached_property
    def cell_surface(self) -> CellSurface:
        """The polygons of the cells."""
        return find_surface(self.cells, len(self.points))

    @property
    def polygons(self) -> PolygonMesh:
        """The surface that the cells are or have."""
        return self.cell_surface.mesh(self.points)

    def surface(self, notes: list[str]) -> Surface:
        """All data arrays as attributes; notes gain a sentence for each thing that is left out."""
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

    def on_surface(self, array: DataArray, domain: Domain) -> npt.NDArray[Any]:
        """The values of an array at the vertices or the polygons of the surface.

        Raises
        ------
        FormatError
            If it has another number of values than there are points or cells.
        """
        n_items = len(self.points) if domain is Domain.VERTEX else len(self.cells.types)
        if len(array.values) != n_items:
            raise FormatError(
                f"array {array.name!r} has {len(array.values)} values; {n_items} are needed"
            )
        return array.values[self.cell_surface.taken[domain]]

    def look(self, notes: list[str]) -> Surface:
        """Texture coordinates, colours and what is said to be one; other data change over time."""
        at_points, at_cells = (
            tuple(one for one in arrays if one.is_look)
            for arrays in (self.point_data, self.cell_data)
        )
        return replace(self, point_data=at_points, cell_data=at_cells).surface(notes)

    @property
    def fields(self) -> Fields:
        """All data of points and cells, on the surface.

        Raises
        ------
        InvalidInputError
            If two arrays at points, or at cells, have one name.
        FormatError
            If an array has another number of values than there are points or cells.
        """
        known: dict[Key, Field] = {}
        found: dict[Key, tuple[npt.NDArray[Any], Field]] = {}
        sides = ((Domain.VERTEX, self.point_data), (Domain.FACE, self.cell_data))
        for domain, array in ((domain, one) for domain, arrays in sides for one in arrays):
            key, values = (domain, array.name), self.on_surface(array, domain)
            # What is not of the surface is a track, also where it does not change.
            is_track = array.is_track or not array.is_look
            field = replace(array.field, is_track=is_track)
            add_field(known, key, field)
            found[key] = values, field
        return found


def joined(meshes: Sequence[VtkMesh]) -> VtkMesh:
    """Several meshes as one; of their data, those that all have alike."""
    if len(meshes) == 1:
        return meshes[0]
    for mesh in meshes:  # a point of another piece must not be meant
        if ((mesh.cells.points < 0) | (mesh.cells.points >= len(mesh.points))).any():
            raise FormatError(f"a cell names a point that is not among {len(mesh.points)}")
    starts = np.cumsum([0] + [len(mesh.points) for mesh in meshes])
    cells = Cells(
        np.concatenate([mesh.cells.types for mesh in meshes]),
        np.concatenate([mesh.cells.counts for mesh in meshes]),
        np.concatenate(
            [mesh.cells.points + start for mesh, start in zip(meshes, starts, strict=False)]
        ),
    )
    point_data = _joined_data([mesh.point_data for mesh in meshes])
    cell_data = _joined_data([mesh.cell_data for mesh in meshes])
    differing = _not_alike(meshes, [*point_data, *cell_data])
    return VtkMesh(
        np.concatenate([mesh.points for mesh in meshes]),
        cells,
        point_data,
        cell_data,
        (*dict.fromkeys(what for mesh in meshes for what in mesh.left_out), *differing),
    )


def _not_alike(meshes: Sequence[VtkMesh], kept: Sequence[DataArray]) -> Iterator[str]:
    """In words, the data that not all of several meshes have alike."""
    names = {one.name for mesh in meshes for one in (*mesh.point_data, *mesh.cell_data)}
    if missing := names - {one.name for one in kept}:
        yield f"arrays that not all pieces have alike: {listed(sorted(missing))}"


def _joined_data(data: Sequence[tuple[DataArray, ...]]) -> tuple[DataArray, ...]:
    found = []
    for first in data[0]:
        same = [one for arrays in data for one in arrays if one.name == first.name]
        if len(same) == len(data) and len({one.values.shape[1:] for one in same}) == 1:
            values = np.concatenate([one.values for one in same])
            found.append(replace(first, values=values))
    return tuple(found)
