"""Writing the tracks of an Alembic mesh: normals, velocities, UVs and other properties."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values
from meshreel.formats.alembic.attributes import COMPUTED, NORMALS, VELOCITIES
from meshreel.formats.alembic.library_arrays import library_array
from meshreel.formats.alembic.names import IN_METADATA, clean, clean_unique_name, unique_name
from meshreel.formats.alembic.track_reading import TRACK_KIND, UNIT
from meshreel.formats.alembic.winding import reversed_corners
from meshreel.formats.alembic.write_attributes import is_texture, scope_of
from meshreel.formats.frames.segmented_stream import SegmentedStream
from meshreel.formats.frames.shared_data import SharedData
from meshreel.formats.notes import (
    note_name,
    note_track_name,
    note_track_type,
    note_unwritten_tracks,
    note_unwritten_units,
)
from meshreel.formats.scenes.parts import PartMesh
from meshreel.model.surface import Domain
from meshreel.model.tracks import TrackKind, TrackSource, value_range
from meshreel.runtime.extras import ALEMBIC

PARAMS = {
    "u1": ("Uchar", "Uchar"), "i1": ("Int32", "Int32"), "i2": ("Int32", "Int32"),
    "u2": ("Int32", "Int32"), "i4": ("Int32", "Int32"), "u4": ("UInt32", "Uint32"),
    "i8": ("Int64", "Int32"), "u8": ("UInt64", "Int32"), "f4": ("Float", "Float"),
    "f8": ("Double", "Double"),
}  # fmt: skip
"""The library's names of scalar property types and their array types, by NumPy type."""

SOURCE_NAME = "sourceName"
UVS = "uv"
STANDARD_NAMES = {
    TrackKind.NORMAL: NORMALS,
    TrackKind.VELOCITY: VELOCITIES,
    TrackKind.UV: UVS,
}
"""The standard mesh properties, which other programs read."""

LONG = ("i8", "u8")
MAX_INT32 = np.iinfo(np.int32).max


def unwritable_tracks(stream: SegmentedStream, shared: SharedData) -> set[str]:
    """Return the names of tracks that Alembic cannot store; notes of the stream name them."""
    long = {str(name) for name, *_, number_type, _ in shared.tracks if number_type[1:] in LONG}
    too_large = {
        name: None
        for mesh in (stream.meshes() if long else ())
        for name, track in mesh.tracks.items()
        if name in long and not _fits_int32(track)
    }
    note_unwritten_tracks(
        too_large, ".abc", stream.notes, "integers beyond 32 bits (a limit of its library)"
    )
    return set(too_large)


def _fits_int32(track: TrackSource) -> bool:
    low, high = value_range(track)
    return bool((abs(low) <= MAX_INT32).all() and (abs(high) <= MAX_INT32).all())


class TrackWriter:
    """Writes the tracks of a mesh, frame by frame.

    Parameters
    ----------
    tracks : mapping of str to TrackSource
    sampling : int
        Index of the time sampling of its positions.
    names : set of str
        Names of the parameters so far; gains those of the tracks.
    notes : list of str
        Gains a sentence for each track whose name or unit changes in the file.
    """

    def __init__(
        self,
        part: PartMesh,
        tracks: Mapping[str, TrackSource],
        sampling: int,
        names: set[str],
        notes: list[str],
    ) -> None:
        self._sampling, self._names, self._notes = sampling, names, notes
        self.use(part)
        available = set(STANDARD_NAMES.values())
        if any(map(is_texture, part.surface.attributes)):
            available.remove(UVS)
        self._standard: dict[str, tuple[str, TrackSource]] = {}
        self._others: dict[str, TrackSource] = {}
        for name, track in tracks.items():
            standard = STANDARD_NAMES.get(track.kind, "")
            if standard in available and _fits(track):
                available.remove(standard)
                self._standard[standard] = name, track
                note_track_type(name, track.dtype, np.dtype(np.float32), notes)
                if standard != UVS:
                    note_track_name(name, standard.strip("."), ".abc", notes)
            else:
                self._others[name] = track
                note_track_type(name, track.dtype, _written_type(track), notes)
        units = {name: track.unit for name, track in self._standard.values()}
        note_unwritten_units(units, ".abc", notes)
        self._params: dict[str, Any] = {}

    def use(self, part: PartMesh) -> None:
        """Write the values of a part of the next segment, which has the same tracks."""
        self._part = part
        self._corner_order = reversed_corners(part.counts)

    def begin(self, schema: Any) -> None:
        """Name the texture coordinates, which must precede the first sample of the mesh."""
        if UVS in self._standard:
            name, _ = self._standard[UVS]
            written_name = unique_name(clean(name, IN_METADATA), self._others)
            note_track_name(name, written_name, ".abc", self._notes)
            schema.setUVSourceName(written_name)

    def add_standard(self, sample: Any, values: Mapping[str, Values]) -> None:
        """Set the standard properties of a mesh sample.

        Parameters
        ----------
        sample : OPolyMeshSchemaSample
        values : mapping of str to array of shape (N, C)
            Values of the frame, for all parts.
        """
        for standard, (name, track) in self._standard.items():
            own = self._own(track, values[name]).astype(np.float32)
            if standard == VELOCITIES:
                sample.setVelocities(library_array("V3f", own))
            elif standard == NORMALS:
                sample.setNormals(_param_sample("N3f", "V3f", own, track))
            else:
                sample.setUVs(_param_sample("V2f", "V2f", own, track))

    def add_others(self, schema: Any, values: Mapping[str, Values]) -> None:
        """Write a sample of each other track, as a geometry parameter.

        Parameters
        ----------
        schema : OPolyMeshSchema
            Its first sample and its attributes are already written.
        values : mapping of str to array of shape (N, C)
        """
        for name, track in self._others.items():
            kind, array, extent = _kind_of(track)
            own = self._own(track, values[name])
            if track.dtype == np.uint8 and track.kind is TrackKind.COLOR:
                own = own / 255
            if name not in self._params:
                self._params[name] = self._param(schema, name, track, kind, extent)
            own = own.astype(_written_type(track))
            self._params[name].set(_param_sample(kind, array, own, track))

    def _own(self, track: TrackSource, values: Values) -> Values:
        """Return the values of this part, with corners in file order."""
        own = values[self._part.items[track.domain]]
        return own[self._corner_order] if track.domain is Domain.CORNER else own

    def _param(self, schema: Any, name: str, track: TrackSource, kind: str, extent: int) -> Any:
        abc, core = ALEMBIC.load("Abc"), ALEMBIC.load("AbcCoreAbstract")
        metadata = core.MetaData()
        self._names.add(property_name := clean_unique_name(name, self._names))
        is_valid = clean(name, IN_METADATA) == name
        # Readers show the source name if there is one.
        note_track_name(name, name if is_valid else property_name, ".abc", self._notes)
        unit = clean(track.unit, IN_METADATA)
        note_name("unit", track.unit, unit, ".abc", self._notes)
        entries = {TRACK_KIND: str(track.kind), SOURCE_NAME: name if is_valid else "", UNIT: unit}
        for key, text in entries.items():
            if text:
                metadata.set(key, text)
        return getattr(ALEMBIC.load("AbcGeom"), f"O{kind}GeomParam")(
            schema.getArbGeomParams(), property_name, False, scope_of(track.domain), extent,
            abc.Argument(self._sampling), abc.Argument(metadata),
        )  # fmt: skip


def normal_sample(normals: Values, of_corner: npt.NDArray[np.int32]) -> Any:
    """Return a sample of normals of shape (R, 3), indexed by `of_corner`."""
    geometry = ALEMBIC.load("AbcGeom")
    sample = geometry.ON3fGeomParamSample()
    sample.setVals(library_array("V3f", normals.astype(np.float32)))
    sample.setIndices(library_array("Uint32", of_corner))
    sample.setScope(scope_of(Domain.CORNER))
    return sample


def mark_computed(schema: Any) -> None:
    """Mark normals as computed by meshreel, so that its reader does not make them a track."""
    mark = ALEMBIC.load("Abc").OStringProperty(schema.getUserProperties(), COMPUTED)
    mark.setValue(NORMALS)


def _fits(track: TrackSource) -> bool:
    """Return whether a standard property, which is float32, can store a track of its kind."""
    if track.kind is TrackKind.VELOCITY:
        return track.domain is Domain.VERTEX
    return track.kind is not TrackKind.UV or track.dtype == np.float32


def _is_color(track: TrackSource) -> bool:
    has_color_type = track.dtype.kind == "f" or track.dtype == np.uint8
    return track.kind is TrackKind.COLOR and has_color_type


def _written_type(track: TrackSource) -> np.dtype[Any]:
    """Return the number type of the geometry parameter in the file."""
    if _is_color(track):
        return np.dtype(np.float32)
    return np.dtype(np.int32) if track.dtype.str[1:] in ("i1", "i2", "u2") else track.dtype


def _kind_of(track: TrackSource) -> tuple[str, str, int]:
    """Return the library's names of the property and array types, and the array extent."""
    width, letter = track.shape[2], track.dtype.str[1:]
    if _is_color(track):
        return f"C{width}f", f"C{width}f", 1
    precision = {"f4": "f", "f8": "d"}.get(letter)
    if precision and (width == 3 or track.kind is TrackKind.UV):
        return f"V{width}{precision}", f"V{width}{precision}", 1
    return *PARAMS[letter], width


def _param_sample(kind: str, array: str, values: Values, track: TrackSource) -> Any:
    sample = getattr(ALEMBIC.load("AbcGeom"), f"O{kind}GeomParamSample")()
    is_flat = array[0] not in "VC"
    if array == "Int32":  # 64-bit tracks have small values here
        values = values.astype(np.int32)
    sample.setVals(library_array(array, values.ravel() if is_flat else values))
    sample.setScope(scope_of(track.domain))
    return sample
