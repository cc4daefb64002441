"""Tracks of an Alembic mesh being written: normals, velocities, texture coordinates, and others."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.alembic.attributes import COMPUTED, NORMALS, VELOCITIES
from meshreel.formats.alembic.library_arrays import library_array
from meshreel.formats.alembic.names import IN_METADATA, clean, numbered, unused_name
from meshreel.formats.alembic.track_reading import TRACK_KIND, UNIT
from meshreel.formats.alembic.winding import turned_corners
from meshreel.formats.alembic.write_attributes import is_texture, scope_of
from meshreel.formats.extras import ALEMBIC
from meshreel.formats.frames.frame_stream import FrameStream
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

Values = npt.NDArray[Any]

PARAMS = {
    "u1": ("Uchar", "Uchar"), "i1": ("Int32", "Int32"), "i2": ("Int32", "Int32"),
    "u2": ("Int32", "Int32"), "i4": ("Int32", "Int32"), "u4": ("UInt32", "Uint32"),
    "i8": ("Int64", "Int32"), "u8": ("UInt64", "Int32"), "f4": ("Float", "Float"),
    "f8": ("Double", "Double"),
}  # fmt: skip
"""The library's names of properties of single numbers of a type, and of arrays that it takes."""

SOURCE_NAME = "sourceName"
TEXTURE = "uv"
MAIN_NAMES = {
    TrackKind.NORMAL: NORMALS,
    TrackKind.VELOCITY: VELOCITIES,
    TrackKind.UV: TEXTURE,
}
"""The properties of every mesh that programs look for."""

MAX_WHOLE = np.iinfo(np.int32).max


def held_tracks(stream: FrameStream) -> dict[str, TrackSource]:
    """The tracks of a stream that a file holds; its notes name the others."""
    too_large = [
        name
        for name, track in stream.tracks.items()
        if track.dtype.str[1:] in ("i8", "u8") and not _is_small(track)
    ]
    note_unwritten_tracks(
        too_large, ".abc", stream.notes, "numbers beyond 32 bits, which its library does not take"
    )
    return {name: one for name, one in stream.tracks.items() if name not in too_large}


def _is_small(track: TrackSource) -> bool:
    low, high = value_range(track)
    return bool((abs(low) <= MAX_WHOLE).all() and (abs(high) <= MAX_WHOLE).all())


class TrackWriter:
    """The tracks of a mesh, whose values are to come.

    Parameters
    ----------
    part : PartMesh
    tracks : mapping of str to TrackSource
    sampling : int
        Number of the time sampling of its positions.
    names : set of str
        Names of parameters of the mesh so far; gains those of the tracks.
    notes : list of str
        Gains a sentence for each track that has another name or unit in the file.
    """

    def __init__(
        self,
        part: PartMesh,
        tracks: Mapping[str, TrackSource],
        sampling: int,
        names: set[str],
        notes: list[str],
    ) -> None:
        self._part, self._sampling, self._names, self._notes = part, sampling, names, notes
        self._turned = turned_corners(part.counts)
        free = set(MAIN_NAMES.values())
        if any(map(is_texture, part.surface.attributes)):
            free.remove(TEXTURE)
        self._main: dict[str, tuple[str, TrackSource]] = {}
        self._others: dict[str, TrackSource] = {}
        for name, track in tracks.items():
            main = MAIN_NAMES.get(track.kind, "")
            if main in free and _fits(track):
                free.remove(main)
                self._main[main] = name, track
                note_track_type(name, track.dtype, np.dtype(np.float32), notes)
                if main != TEXTURE:
                    note_track_name(name, main.strip("."), ".abc", notes)
            else:
                self._others[name] = track
                note_track_type(name, track.dtype, _written_type(track), notes)
        units = {name: track.unit for name, track in self._main.values()}
        note_unwritten_units(units, ".abc", notes)
        self._params: dict[str, Any] = {}

    def begin(self, schema: Any) -> None:
        """Tell the mesh what its texture coordinates are called, before any sample is written."""
        if TEXTURE in self._main:
            name, _ = self._main[TEXTURE]
            called = numbered(clean(name, IN_METADATA), self._others)
            note_track_name(name, called, ".abc", self._notes)
            schema.setUVSourceName(called)

    def add_to(self, sample: Any, values: Mapping[str, Values]) -> None:
        """Put into a sample of the mesh what every mesh has a place for.

        Parameters
        ----------
        sample : OPolyMeshSchemaSample
        values : mapping of str to array of shape (N, C)
            Of the frame, of all meshes.
        """
        for main, (name, track) in self._main.items():
            own = self._own(track, values[name]).astype(np.float32)
            if main == VELOCITIES:
                sample.setVelocities(library_array("V3f", own))
            elif main == NORMALS:
                sample.setNormals(_param_sample("N3f", "V3f", own, track))
            else:
                sample.setUVs(_param_sample("V2f", "V2f", own, track))

    def add_others(self, schema: Any, values: Mapping[str, Values]) -> None:
        """Write a sample of all other tracks, which are geometry parameters.

        Parameters
        ----------
        schema : OPolyMeshSchema
            Which has its first sample, and its attributes.
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
        """Values of this mesh, with corners in the order of the file."""
        own = values[self._part.items[track.domain]]
        return own[self._turned] if track.domain is Domain.CORNER else own

    def _param(self, schema: Any, name: str, track: TrackSource, kind: str, extent: int) -> Any:
        abc, core = ALEMBIC.load("Abc"), ALEMBIC.load("AbcCoreAbstract")
        metadata = core.MetaData()
        self._names.add(place := unused_name(name, self._names))
        is_source = clean(name, IN_METADATA) == name
        called = name if is_source else place  # by which readers know it
        note_track_name(name, called, ".abc", self._notes)
        unit = clean(track.unit, IN_METADATA)
        note_name("unit", track.unit, unit, ".abc", self._notes)
        said = {TRACK_KIND: str(track.kind), SOURCE_NAME: name if is_source else "", UNIT: unit}
        for key, text in said.items():
            if text:
                metadata.set(key, text)
        return getattr(ALEMBIC.load("AbcGeom"), f"O{kind}GeomParam")(
            schema.getArbGeomParams(), place, False, scope_of(track.domain), extent,
            abc.Argument(self._sampling), abc.Argument(metadata),
        )  # fmt: skip


def normal_sample(normals: Values, of_corner: npt.NDArray[np.int32]) -> Any:
    """Normals of a frame, of shape (R, 3), the row of which each corner of the file names."""
    geometry = ALEMBIC.load("AbcGeom")
    sample = geometry.ON3fGeomParamSample()
    sample.setVals(library_array("V3f", normals.astype(np.float32)))
    sample.setIndices(library_array("Uint32", of_corner))
    sample.setScope(scope_of(Domain.CORNER))
    return sample


def mark_computed(schema: Any) -> None:
    """Tell readers of ours that normals follow from faces and hard edges, and are no track."""
    mark = ALEMBIC.load("Abc").OStringProperty(schema.getUserProperties(), COMPUTED)
    mark.setValue(NORMALS)


def _fits(track: TrackSource) -> bool:
    """Whether a track can be what every mesh has a place for, which is of float32."""
    if track.kind is TrackKind.VELOCITY:
        return track.domain is Domain.VERTEX
    return track.kind is not TrackKind.UV or track.dtype == np.float32


def _is_color(track: TrackSource) -> bool:
    is_fit = track.dtype.kind == "f" or track.dtype == np.uint8
    return track.kind is TrackKind.COLOR and is_fit


def _written_type(track: TrackSource) -> np.dtype[Any]:
    """The type of numbers of a geometry parameter in the file; values of 64 bits are small."""
    if _is_color(track):
        return np.dtype(np.float32)
    return np.dtype(np.int32) if track.dtype.str[1:] in ("i1", "i2", "u2") else track.dtype


def _kind_of(track: TrackSource) -> tuple[str, str, int]:
    """The library's names of a property and of its arrays, and how many numbers are a value."""
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
    if array == "Int32":  # which also stands for small numbers of 64 bits
        values = values.astype(np.int32)
    sample.setVals(library_array(array, values.ravel() if is_flat else values))
    sample.setScope(scope_of(track.domain))
    return sample
