"""Data arrays of VTK, at points and cells, to attributes of a surface."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.frames.field_tracks import COLOR_NAMES, NORMALS, UV_NAMES, Field
from meshreel.formats.notes import note_kinds, note_normals
from meshreel.formats.vtk.cells import CellSurface
from meshreel.model.surface import MAX_NUMBERS, VALUE_TYPES, Attribute, Domain, Kind, Surface

TEXTURE_COORDINATES = "TCoords"
UNFIT = f"arrays of text, or of more than {MAX_NUMBERS} numbers"
"""Contents of arrays that attributes cannot hold."""


@dataclass(frozen=True, eq=False)
class DataArray:
    """Values at the points or cells of a mesh.

    Parameters
    ----------
    name : str
    values : array of shape (N,) or (N, C)
    role : str, default ""
        What it is active as: "TCoords", "Normals" and others.
    kind, unit : str, default ""
        What the file says of it, as attribute or track.
    is_track : bool, default False
        Whether the file says that it is a track, even if it never changes.
    """

    name: str
    values: npt.NDArray[Any]
    role: str = ""
    kind: str = ""
    unit: str = ""
    is_track: bool = False

    @property
    def is_look(self) -> bool:
        """Whether it is an attribute in a file of one frame: by what it means, or what is said."""
        is_said = bool(self.kind) and not self.is_track
        return is_said or kind_of(self) is not Kind.OTHER

    @property
    def field(self) -> Field:
        """What is known of it without its numbers."""
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
    """The attributes that arrays at all points and cells are on the surface of the cells.

    Normals, arrays of more numbers than an attribute has, and text are left out; notes say so.

    Raises
    ------
    FormatError
        If an array has another number of values.
    """
    at_points = [(one, Domain.VERTEX, n_points, surface.kept) for one in points]
    at_cells = [(one, Domain.FACE, n_cells, surface.cells) for one in cells]
    found = [(one[0], _attribute(*one)) for one in at_points + at_cells]
    missing = [array for array, attribute in found if attribute is None]
    if any(array.role == NORMALS for array in missing):
        note_normals(notes)
    note_kinds(notes, UNFIT, (array.name for array in missing if array.role != NORMALS))
    return Surface(attributes=tuple(one for _, one in found if one is not None))


def _attribute(
    array: DataArray, domain: Domain, n_items: int, taken: npt.NDArray[np.int64] | slice
) -> Attribute | None:
    values = array.values
    if len(values) != n_items:
        raise FormatError(f"array {array.name!r} has {len(values)} values; {n_items} are needed")
    values = values.reshape(n_items, -1)
    if array.role == NORMALS or values.dtype.kind not in "iuf" or values.shape[1] > MAX_NUMBERS:
        return None
    values = _allowed(values[taken])
    return Attribute(array.name, kind_of(array), domain, values)


def _allowed(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The values in a type that attributes have, which holds them as they are if one does."""
    if values.dtype in VALUE_TYPES:
        return values
    if values.dtype.kind == "f":
        return values.astype(np.float32 if values.dtype.itemsize < 4 else np.float64)
    limits = np.iinfo(np.int32)
    is_small = values.size == 0 or (limits.min <= values.min() and values.max() <= limits.max)
    return values.astype(np.int32 if is_small else np.float64)


def kind_of(array: DataArray) -> Kind:
    """What an array means as an attribute."""
    values, name = array.values, array.name.lower()
    width, is_float = math.prod(values.shape[1:]), values.dtype.kind == "f"
    is_uv = array.kind == Kind.UV or array.role == TEXTURE_COORDINATES
    if width == 2 and is_float and (is_uv or name in UV_NAMES):
        return Kind.UV
    is_color = array.kind == Kind.COLOR or name in COLOR_NAMES
    if width in (3, 4) and (values.dtype == np.uint8 or (is_float and is_color)):
        return Kind.COLOR
    return Kind.OTHER
