"""Tracks of a stage being written: time-sampled primvars, normals and velocities of a mesh."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from meshreel.arrays import Values
from meshreel.formats.extras import USD
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.usd.mesh_writing import INTERPOLATIONS, MeshWriter, named_attributes
from meshreel.formats.usd.prim_names import different, prim_name
from meshreel.formats.usd.quantities import TRACK_KIND, TRACK_NAME, UNIT
from meshreel.model.surface import Domain
from meshreel.model.tracks import TrackKind, TrackSource

ELEMENTS = {
    "u1": "uchar", "i1": "int", "u2": "int", "i2": "int", "i4": "int", "u4": "uint",
    "i8": "int64", "u8": "uint64", "f4": "float", "f8": "double",
}  # fmt: skip
"""What USD calls numbers of a type, or of one that holds all of them."""

VELOCITIES, NORMALS = "velocities", "normals"
COLOR, OPACITY, TEXTURE = "displayColor", "displayOpacity", "st"
MAIN_NAMES = {
    TrackKind.VELOCITY: VELOCITIES,
    TrackKind.NORMAL: NORMALS,
    TrackKind.COLOR: COLOR,
    TrackKind.UV: TEXTURE,
}
"""The names that programs look for first."""


class TrackWriter:
    """A track of a mesh, whose values are to come.

    Parameters
    ----------
    name : str
        Of the track.
    items : slice
        Where the values of the mesh are among those of all.
    columns : slice
        The numbers of each value that are written.
    attribute : Usd.Attribute
    type_name : Sdf.ValueTypeName
    is_flat : bool
        Whether several elements of USD are one value.
    scale : float
        By which numbers are divided.
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
        """Add the values of a frame, of shape (N, C), those of other meshes too.

        Parameters
        ----------
        values : array
        code : float or None
            The time code; None for values that are the same at all times.
        """
        own = values[self._items, self._columns]
        own = (own / self._scale if self._scale != 1 else own).astype(self._dtype)
        data = np.ascontiguousarray(own.ravel() if self._is_flat else own)
        when = USD.load("Usd").TimeCode.Default() if code is None else code
        self._attribute.Set(self._array.FromNumpy(data), when)


def part_tracks(mesh: MeshWriter, stream: FrameStream) -> Iterator[TrackWriter]:
    """The tracks of a stream for a mesh of it, whose attributes are written.

    The first velocities of vertices are those of the mesh, the first normals its normals; the
    first colours are called ``displayColor``, the first texture coordinates ``st``, unless
    attributes are. The notes of the stream gain a sentence where numbers have another type in USD.
    """
    taken = {name for _, name in named_attributes(mesh.part.surface)}
    taken |= {OPACITY} if COLOR in taken else set()
    for name, track in stream.tracks.items():
        yield from _writers(mesh, name, track, taken, stream.notes)


def _writers(
    mesh: MeshWriter, name: str, track: TrackSource, taken: set[str], notes: list[str]
) -> Iterator[TrackWriter]:
    found, n_columns = _free_name(name, track, taken), track.shape[2]
    splits_opacity = found == COLOR and n_columns == 4
    is_flat, kind = _type_name(found, track, 3 if splits_opacity else n_columns)
    declared = USD.load("Sdf").ValueTypeNames.Find(f"{kind}[]")
    scale = 255.0 if track.kind is TrackKind.COLOR and track.dtype == np.uint8 else 1.0
    _note_type(name, track, kind, notes)

    def writer(place: str, type_name: Any, columns: slice, element_size: int) -> TrackWriter:
        attribute = _attribute(mesh, place, type_name, track, element_size)
        _describe(attribute, name, track)
        items = mesh.part.items[track.domain]
        is_single = type_name in _single_types()
        return TrackWriter(
            name, items, columns, attribute, type_name, is_flat=is_single, scale=scale
        )

    if not splits_opacity:
        yield writer(found, declared, slice(None), n_columns if is_flat else 1)
        return
    taken.add(OPACITY)
    yield writer(COLOR, declared, slice(0, 3), 1)
    yield writer(OPACITY, USD.load("Sdf").ValueTypeNames.FloatArray, slice(3, 4), 1)


def _single_types() -> list[Any]:
    """Types of arrays of single numbers."""
    find = USD.load("Sdf").ValueTypeNames.Find
    return [find(f"{element}[]") for element in set(ELEMENTS.values())]


def _free_name(name: str, track: TrackSource, taken: set[str]) -> str:
    """The name of a primvar, or of an attribute of meshes, that nothing has yet; it is taken."""
    main = MAIN_NAMES.get(track.kind, "")
    can_be = main != VELOCITIES or track.domain is Domain.VERTEX
    if main and can_be and main not in taken and not (main == COLOR and OPACITY in taken):
        taken.add(main)
        return main
    # Primvars of these names would be taken for what they are not.
    found = different(prim_name(name), taken | {*MAIN_NAMES.values(), OPACITY})
    taken.add(found)
    return found


def _type_name(name: str, track: TrackSource, n_columns: int) -> tuple[bool, str]:
    """Whether single numbers are written, and what USD calls the type of one or of a value."""
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
    """Tell of numbers that are of another type in USD."""
    letter = kind[-1] if kind[-2].isdigit() else kind[0]
    is_rounded = track.dtype == np.float64 and letter == "f"
    is_scaled = track.dtype == np.uint8 and kind.startswith("color")
    is_widened = track.dtype.str[1:] in ("i1", "i2", "u2")
    if is_rounded or is_scaled or is_widened:
        what = "int32" if is_widened else "float32"
        note = f"track {name!r} is written as {what}, not {track.dtype}, as USD has it"
        notes.extend([note] if note not in notes else [])


def _attribute(
    mesh: MeshWriter, name: str, type_name: Any, track: TrackSource, element_size: int
) -> Any:
    geometry = USD.load("UsdGeom")
    interpolation = INTERPOLATIONS[track.domain]
    if name == VELOCITIES:
        return geometry.Mesh(mesh.prim).CreateVelocitiesAttr()
    if name == NORMALS:
        drawn = geometry.Mesh(mesh.prim)
        drawn.SetNormalsInterpolation(interpolation)
        return drawn.CreateNormalsAttr()
    api = geometry.PrimvarsAPI(mesh.prim)
    return api.CreatePrimvar(name, type_name, interpolation, element_size).GetAttr()


def _describe(attribute: Any, name: str, track: TrackSource) -> None:
    """Write what a track is, for which USD has no place, as custom data."""
    said = {TRACK_KIND: str(track.kind), TRACK_NAME: name, UNIT: track.unit}
    for key, text in said.items():
        if text:
            attribute.SetCustomDataByKey(key, text.encode("utf-8", "replace").decode())
