"""Conversion of VTK point and cell data arrays to surface attributes."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.frames.field_tracks import COLOR_NAMES, NORMALS, UV_NAMES, Field
from meshreel.formats.notes import note_kinds, note_normals
from meshreel.formats.surfaces.cells import CellSurface
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
