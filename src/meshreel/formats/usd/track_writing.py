"""Writing tracks of a mesh: time-sampled primvars, normals and velocities."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from meshreel.arrays import Values
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.usd.mesh_writing import INTERPOLATIONS, MeshWriter, primvar_names
from meshreel.formats.usd.prim_names import prim_name, unique_name
from meshreel.formats.usd.quantities import TRACK_KIND, TRACK_NAME, UNIT
from meshreel.model.surface import Domain
from meshreel.model.tracks import TrackKind, TrackSource
from meshreel.runtime.extras import USD

ELEMENTS = {
    "u1": "uchar", "i1": "int", "u2": "int", "i2": "int", "i4": "int", "u4": "uint",
    "i8": "int64", "u8": "uint64", "f4": "float", "f8": "double",
}  # fmt: skip
"""USD's element type for each number type, without loss."""

VELOCITIES, NORMALS = "velocities", "normals"
COLOR, OPACITY, UVS = "displayColor", "displayOpacity", "st"
STANDARD_NAMES = {
    TrackKind.VELOCITY: VELOCITIES,
    TrackKind.NORMAL: NORMALS,
    TrackKind.COLOR: COLOR,
    TrackKind.UV: UVS,
}
"""Standard names, which programs use by default."""


class TrackWriter:
    """Writes a track of a mesh, frame by frame.

    Parameters
    ----------
    name : str
        Name of the track.
    items : slice
        Items of the mesh among those of the sequence.
    columns : slice
        Components of a value to write.
    attribute : Usd.Attribute
    type_name : Sdf.ValueTypeName
    is_flat : bool
        Whether a value consists of several elements.
    scale : float
        Divisor of the numbers.
    """

    def __init__(
        self,
        name: str,
        items: slice,
        columns: slice,
        attribute: Any,
        type_name: Any,
        *,
        is_flat: bool,
        scale: float,
    ) -> None:
        self.name = name
        self._items, self._columns, self._scale = items, columns, scale
        self._attribute, self._is_flat = attribute, is_flat
        self._array = getattr(USD.load("Vt"), type_name.type.pythonClass.__name__)
        self._dtype = np.asarray(self._array(1)).dtype

    def write(self, values: Values, code: float | None) -> None:
        """Write the values of a frame.

        Parameters
        ----------
        values : array of shape (N, C)
            Values of all meshes of the sequence.
        code : float or None
            The time code; None writes the default value.
        """
        own = values[self._items, self._columns]
        own = (own / self._scale if self._scale != 1 else own).astype(self._dtype)
        data = np.ascontiguousarray(own.ravel() if self._is_flat else own)
        when = USD.load("Usd").TimeCode.Default() if code is None else code
        self._attribute.Set(self._array.FromNumpy(data), when)


def track_writers(mesh: MeshWriter, stream: FrameStream) -> Iterator[TrackWriter]:
    """Yield writers for the tracks of a stream on one of its meshes.

    The first vertex velocities and normals become those of the mesh; the first colors are called
    ``displayColor`` and the first UVs ``st``, unless attributes have these names. Notes of the
    stream gain a sentence where USD stores another number type.
    """
    used = {name for _, name in primvar_names(mesh.part.surface)}
    used |= {OPACITY} if COLOR in used else set()
    for name, track in stream.tracks.items():
        yield from _writers(mesh, name, track, used, stream.notes)


def _writers(
    mesh: MeshWriter, name: str, track: TrackSource, used: set[str], notes: list[str]
) -> Iterator[TrackWriter]:
    written_name, n_columns = _choose_name(name, track, used), track.shape[2]
    splits_opacity = written_name == COLOR and n_columns == 4
    is_flat, kind = _type_name(written_name, track, 3 if splits_opacity else n_columns)
    declared = USD.load("Sdf").ValueTypeNames.Find(f"{kind}[]")
    scale = 255.0 if track.kind is TrackKind.COLOR and track.dtype == np.uint8 else 1.0
    _note_type(name, track, kind, notes)

    def writer(primvar: str, type_name: Any, columns: slice, element_size: int) -> TrackWriter:
        attribute = _attribute(mesh, primvar, type_name, track, element_size)
        _write_custom_data(attribute, name, track)
        items = mesh.part.items[track.domain]
        is_element = type_name in _element_types()
        return TrackWriter(
            name, items, columns, attribute, type_name, is_flat=is_element, scale=scale
        )

    if not splits_opacity:
        yield writer(written_name, declared, slice(None), n_columns if is_flat else 1)
        return
    used.add(OPACITY)
    yield writer(COLOR, declared, slice(0, 3), 1)
    yield writer(OPACITY, USD.load("Sdf").ValueTypeNames.FloatArray, slice(3, 4), 1)


def _element_types() -> list[Any]:
    """Return the array types of single numbers."""
    find = USD.load("Sdf").ValueTypeNames.Find
    return [find(f"{element}[]") for element in set(ELEMENTS.values())]


def _choose_name(name: str, track: TrackSource, used: set[str]) -> str:
    """Return an unused name of a primvar or mesh attribute, and add it to `used`."""
    standard = STANDARD_NAMES.get(track.kind, "")
    is_possible = standard != VELOCITIES or track.domain is Domain.VERTEX
    has_opacity = standard == COLOR and OPACITY in used
    if standard and is_possible and standard not in used and not has_opacity:
        used.add(standard)
        return standard
    # Programs would misinterpret other tracks with standard names.
    unique = unique_name(prim_name(name), used | {*STANDARD_NAMES.values(), OPACITY})
    used.add(unique)
    return unique


def _type_name(name: str, track: TrackSource, n_columns: int) -> tuple[bool, str]:
    """Return whether single numbers are written, and USD's name of the type."""
    element = ELEMENTS[track.dtype.str[1:]]
    if name in (VELOCITIES, NORMALS):
        return False, {VELOCITIES: "vector3f", NORMALS: "normal3f"}[name]
    if track.kind is TrackKind.COLOR and (track.dtype.kind == "f" or track.dtype == np.uint8):
        is_double = track.dtype == np.float64 and name != COLOR
        return False, f"color{n_columns}{'d' if is_double else 'f'}"
    if element in ("float", "double"):
        letter = element[0]
        if track.kind is TrackKind.UV:
            return False, f"texCoord2{letter}"
        if track.kind in (TrackKind.VECTOR, TrackKind.VELOCITY) and n_columns == 3:
            return False, f"vector3{letter}"
        if track.kind is TrackKind.NORMAL:
            return False, f"normal3{letter}"
    return True, element


def _note_type(name: str, track: TrackSource, kind: str, notes: list[str]) -> None:
    """Note that USD stores another number type."""
    letter = kind[-1] if kind[-2].isdigit() else kind[0]
    is_rounded = track.dtype == np.float64 and letter == "f"
    is_scaled = track.dtype == np.uint8 and kind.startswith("color")
    is_widened = track.dtype.str[1:] in ("i1", "i2", "u2")
    if is_rounded or is_scaled or is_widened:
        written = "int32" if is_widened else "float32"
        note = f"track {name!r} is written as {written}, not {track.dtype}, a type that USD lacks"
        notes.extend([note] if note not in notes else [])


def _attribute(
    mesh: MeshWriter, name: str, type_name: Any, track: TrackSource, element_size: int
) -> Any:
    geometry = USD.load("UsdGeom")
    interpolation = INTERPOLATIONS[track.domain]
    if name == VELOCITIES:
        return geometry.Mesh(mesh.prim).CreateVelocitiesAttr()
    if name == NORMALS:
        usd_mesh = geometry.Mesh(mesh.prim)
        usd_mesh.SetNormalsInterpolation(interpolation)
        return usd_mesh.CreateNormalsAttr()
    api = geometry.PrimvarsAPI(mesh.prim)
    return api.CreatePrimvar(name, type_name, interpolation, element_size).GetAttr()


def _write_custom_data(attribute: Any, name: str, track: TrackSource) -> None:
    """Write the kind, name and unit of a track, for which USD has no schema, as custom data."""
    entries = {TRACK_KIND: str(track.kind), TRACK_NAME: name, UNIT: track.unit}
    for key, text in entries.items():
        if text:
            attribute.SetCustomDataByKey(key, text.encode("utf-8", "replace").decode())
