"""Writer of one part of a mesh to an Alembic file, frame by frame."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from meshreel.arrays import Singles, Values
from meshreel.formats.alembic.attributes import (
    COMPUTED,
    NORMALS,
    SEGMENT_ATTRIBUTES,
    TRACK_KIND,
    UNIT,
    UVS,
    VELOCITIES,
)
from meshreel.formats.alembic.library import (
    NOT_IN_METADATA,
    NOT_IN_TEXTS,
    NUMBER_TYPES,
    PropertyType,
    clean,
    clean_unique_name,
    library_array,
    param_sample,
    scope_of,
)
from meshreel.formats.frames.shared_data import SharedData
from meshreel.formats.scenes.parts import PartMesh, unique_name
from meshreel.formats.surfaces.polygons import reversed_corners
from meshreel.model.colors import unit_colors
from meshreel.model.geometry.hard_edges import RowNormals
from meshreel.model.notes import Notes, note_name, note_track_type, note_unwritten_units
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind
from meshreel.model.tracks import TrackKind, TrackSource, is_color
from meshreel.runtime.extras import ALEMBIC

STANDARD_NAMES = {
    TrackKind.NORMAL: NORMALS,
    TrackKind.VELOCITY: VELOCITIES,
    TrackKind.UV: UVS,
}
"""The standard mesh properties, which other programs read."""

UV_TYPE = "V2f", "V2f", 1


class PartWriter:
    """Writes the mesh of a part.

    Attributes and groups have a sample per frame if the sequence has several segments, otherwise
    one.

    Parameters
    ----------
    schema : OPolyMeshSchema
        Of the library.
    part : PartMesh
        The part in the first segment.
    sampling : int
        Index of the time sampling of its positions.
    notes : Notes
        Gains a sentence for everything that the file cannot store exactly.
    segment_data : SharedData, optional
        Data of all segments, if there are several.
    """

    def __init__(
        self,
        schema: Any,
        part: PartMesh,
        sampling: int,
        tracks: Mapping[str, TrackSource],
        notes: Notes,
        segment_data: SharedData | None,
    ) -> None:
        self._schema, self._sampling, self._notes = schema, sampling, notes
        self._segment_data = segment_data
        self._has_normals = part.writes_edge_normals(tracks, segment_data)
        self._names: set[str] = set()
        self._is_first_frame = True
        self._params: dict[str | int, Any] = {}
        self._track_params: dict[str, Any] = {}
        self._face_sets: dict[str, Any] = {}
        self._face_set_names: set[str] = set()
        self._face_samples: list[tuple[Any, Any]] = []

        # Standard properties are float32; the other tracks are geometry parameters.
        available = set(STANDARD_NAMES.values())
        if any(map(_is_texture, part.surface.attributes)):
            available.remove(UVS)
        self._standard: dict[str, tuple[str, TrackSource]] = {}
        self._param_tracks: dict[str, TrackSource] = {}
        for name, track in tracks.items():
            standard, dtype = STANDARD_NAMES.get(track.kind, ""), np.dtype(np.float32)
            fits = track.kind is not TrackKind.UV or track.dtype == np.float32
            fits = fits and (track.kind is not TrackKind.VELOCITY or track.domain is Domain.VERTEX)
            if standard in available and fits:
                available.remove(standard)
                self._standard[standard] = name, track
            else:
                self._param_tracks[name], standard, dtype = track, "", _written_type(track)
            note_track_type(name, track.dtype, dtype, notes)
            if standard not in ("", UVS):
                note_name("track", name, standard.strip("."), ".abc", notes)
        units = {name: track.unit for name, track in self._standard.values()}
        note_unwritten_units(units, ".abc", notes)

    def begin(self, part: PartMesh) -> None:
        """Begin a segment with the part in it."""
        self._part, self._is_segment_start = part, True
        self._corner_order = reversed_corners(part.counts)
        self._shading: RowNormals | None = part.edge_normals() if self._has_normals else None

    def add(self, frame: Singles, values: Mapping[str, Values]) -> None:
        """Write the next frame, from positions of shape (V, 3) and track values of all parts."""
        sample = ALEMBIC.load("AbcGeom").OPolyMeshSchemaSample()
        sample.setPositions(library_array("V3f", frame[self._part.verts]))
        for standard, (name, track) in self._standard.items():
            part_values = self._part_values(track, values[name]).astype(np.float32)
            if standard == VELOCITIES:
                sample.setVelocities(library_array("V3f", part_values))
            elif standard == NORMALS:
                sample.setNormals(param_sample("N3f", "V3f", track.domain, part_values))
            else:
                sample.setUVs(param_sample("V2f", "V2f", track.domain, part_values))
        if self._shading is not None:
            normals = self._shading.of_frames(frame[np.newaxis, self._part.verts])[0]
            rows = self._shading.rows.of_corner[self._corner_order]
            normals = normals.astype(np.float32)
            sample.setNormals(param_sample("N3f", "V3f", Domain.CORNER, normals, rows))
        if self._is_segment_start:
            self._write_segment_start(sample)
        else:  # the library repeats the faces
            self._schema.set(sample)
            if self._segment_data is not None:
                for param in self._params.values():
                    param.setFromPrevious()
                for face_set, faces in self._face_samples:
                    face_set.set(faces)
        for name, track in self._param_tracks.items():
            self._write_track(name, track, self._part_values(track, values[name]))
        self._is_segment_start = self._is_first_frame = False

    def _part_values(self, track: TrackSource, values: Values) -> Values:
        """Return the values of this part, with corners in file order."""
        part_values = values[self._part.items[track.domain]]
        is_corner = track.domain is Domain.CORNER
        return part_values[self._corner_order] if is_corner else part_values

    def _write_segment_start(self, sample: Any) -> None:
        """Write the first sample of a segment, with its faces, attributes and groups."""
        counts, attributes = self._part.counts, self._part.surface.attributes
        sample.setFaceCounts(library_array("Int32", counts))
        sample.setFaceIndices(library_array("Int32", self._part.corners[self._corner_order]))
        texture = next((attribute for attribute in attributes if _is_texture(attribute)), None)
        if self._is_first_frame:
            self._name_uvs(texture)
            if self._shading is not None:
                self._mark(COMPUTED, NORMALS)
        if texture is not None:
            sample.setUVs(self._attribute_sample(texture, UV_TYPE))
        self._schema.set(sample)
        other_attributes = [attribute for attribute in attributes if attribute is not texture]
        for number, attribute in enumerate(other_attributes):
            kind = _attribute_type(attribute)
            if number not in self._params:
                name = self._new_name("attribute", attribute.name)
                self._params[number] = self._param(
                    name, attribute.domain, kind, is_indexed=attribute.indices is not None
                )
            self._params[number].set(self._attribute_sample(attribute, kind))
        for group in self._part.surface.groups:
            if group.name == "material":
                self._write_face_sets(group)
        for group in self._part.surface.groups:
            if group.name != "material":
                self._write_texts(group)
        if self._is_first_frame and self._segment_data is not None:
            # Our reader makes no track of these properties; their names contain no "/".
            names = [*sorted(self._names), *([] if texture is None else [UVS])]
            self._mark(SEGMENT_ATTRIBUTES, "/".join(names))

    def _name_uvs(self, texture: Attribute | None) -> None:
        """Name the texture coordinates, which must precede the first sample."""
        if texture is not None:
            what, name = "attribute", texture.name
            attributes = self._part.surface.attributes
            used = {attribute.name for attribute in attributes if attribute is not texture}
        elif UVS in self._standard:
            what, (name, _), used = "track", self._standard[UVS], set(self._param_tracks)
        else:
            return
        written_name = unique_name(clean(name, NOT_IN_METADATA), used)
        note_name(what, name, written_name, ".abc", self._notes)
        self._schema.setUVSourceName(written_name)

    def _mark(self, name: str, text: str) -> None:
        """Write a user property, which our reader looks for."""
        user = self._schema.getUserProperties()
        ALEMBIC.load("Abc").OStringProperty(user, name).setValue(text)

    def _new_name(self, what: str, name: str) -> str:
        written_name = clean_unique_name(name, self._names)
        note_name(what, name, written_name, ".abc", self._notes)
        return written_name

    def _param(
        self,
        name: str,
        domain: Domain,
        kind: PropertyType,
        metadata: Mapping[str, str] | None = None,
        *,
        is_indexed: bool,
    ) -> Any:
        """Create a geometry parameter: of a track, if it has metadata, or else of an attribute."""
        argument, entries = ALEMBIC.load("Abc").Argument, ALEMBIC.load("AbcCoreAbstract").MetaData()
        is_sampled = metadata is not None or self._segment_data is not None
        arguments = [argument(self._sampling)] if is_sampled else []
        for key, text in (metadata or {}).items():
            entries.set(key, text)
        arguments += [] if metadata is None else [argument(entries)]
        create = getattr(ALEMBIC.load("AbcGeom"), f"O{kind[0]}GeomParam")
        params = self._schema.getArbGeomParams()
        return create(params, name, is_indexed, scope_of(domain), kind[2], *arguments)

    def _attribute_sample(self, attribute: Attribute, kind: PropertyType) -> Any:
        """Return a sample of an attribute, with corners in file order."""
        values, indices = attribute.values, attribute.indices
        if kind[0] in ("V2f", "C3f", "C4f") and values.dtype != np.float32:
            is_bytes = attribute.kind is Kind.COLOR and values.dtype.kind != "f"
            values = (unit_colors(values) if is_bytes else values).astype(np.float32)
            if is_bytes or (values != attribute.values).any():
                dtype = attribute.values.dtype
                self._notes.changed(
                    f"{attribute.kind} {attribute.name!r} is written as float32, not {dtype}"
                )
        if attribute.domain is Domain.CORNER:
            order = self._corner_order
            values = values[order] if indices is None else values
            indices = None if indices is None else indices[order]
        return param_sample(*kind[:2], attribute.domain, values, indices)

    def _write_texts(self, groups: FaceGroups) -> None:
        """Write groups as a text per face."""
        if groups.name not in self._params:
            name, kind = self._new_name("group", groups.name), ("String", "String", 1)
            self._params[groups.name] = self._param(name, Domain.FACE, kind, is_indexed=True)
        labels = [clean(label, NOT_IN_TEXTS) for label in groups.labels]
        for label, cleaned in zip(groups.labels, labels, strict=True):
            note_name("label", label, cleaned, ".abc", self._notes)
        empty = len(groups.labels)  # index of the empty text at the end
        numbers = np.where(groups.numbers < 0, empty, groups.numbers)
        sample = param_sample("String", "String", Domain.FACE, [*labels, ""], numbers)
        self._params[groups.name].set(sample)

    def _write_face_sets(self, groups: FaceGroups) -> None:
        """Write a face set for each material, of all segments if there are several."""
        labels = groups.labels
        if self._segment_data is not None:
            labels = self._segment_data.labels.get(("material",), ())
        self._face_samples = []
        for label in labels:
            if label not in self._face_sets:
                name = clean_unique_name(label, self._face_set_names)
                note_name("material", label, name, ".abc", self._notes)
                face_set = self._face_sets[label] = self._schema.createFaceSet(name).getSchema()
                if self._segment_data is not None:
                    face_set.setTimeSampling(self._sampling)
            number = groups.labels.index(label) if label in groups.labels else -2
            faces = np.flatnonzero(groups.numbers == number).astype(np.int32)
            sample = ALEMBIC.load("AbcGeom").OFaceSetSchemaSample()
            sample.setFaces(library_array("Int32", faces))
            self._face_sets[label].set(sample)
            self._face_samples.append((self._face_sets[label], sample))

    def _write_track(self, name: str, track: TrackSource, values: Values) -> None:
        """Write a sample of a track as a geometry parameter."""
        kind = _track_type(track)
        if name not in self._track_params:
            written_name = clean_unique_name(name, self._names)
            is_valid = clean(name, NOT_IN_METADATA) == name
            # Readers show the source name if there is one.
            note_name("track", name, name if is_valid else written_name, ".abc", self._notes)
            unit = clean(track.unit, NOT_IN_METADATA)
            note_name("unit", track.unit, unit, ".abc", self._notes)
            entries = {
                TRACK_KIND: str(track.kind),
                "sourceName": name if is_valid else "",
                UNIT: unit,
            }
            self._track_params[name] = self._param(
                written_name, track.domain, kind, entries, is_indexed=False
            )
        if is_color(track.kind, track.dtype):
            values = unit_colors(values)
        values = values.astype(_written_type(track))
        self._track_params[name].set(param_sample(*kind[:2], track.domain, values))


def _is_texture(attribute: Attribute) -> bool:
    """Return whether an attribute is two-dimensional texture coordinates."""
    return attribute.kind is Kind.UV and attribute.values.shape[1] == 2


def _attribute_type(attribute: Attribute) -> PropertyType:
    width = attribute.values.shape[1]
    if _is_texture(attribute):
        return UV_TYPE
    if attribute.kind is Kind.COLOR and width in (3, 4):
        return f"C{width}f", f"C{width}f", 1
    return *NUMBER_TYPES[attribute.values.dtype.str[1:]], width


def _track_type(track: TrackSource) -> PropertyType:
    width, letter = track.shape[2], track.dtype.str[1:]
    if is_color(track.kind, track.dtype):
        return f"C{width}f", f"C{width}f", 1
    precision = {"f4": "f", "f8": "d"}.get(letter)
    if precision and (width == 3 or track.kind is TrackKind.UV):
        return f"V{width}{precision}", f"V{width}{precision}", 1
    return *NUMBER_TYPES[letter], width


def _written_type(track: TrackSource) -> np.dtype[Any]:
    """Return the number type of the geometry parameter in the file."""
    if is_color(track.kind, track.dtype):
        return np.dtype(np.float32)
    return np.dtype(np.int32) if track.dtype.str[1:] in ("i1", "i2", "u2") else track.dtype
