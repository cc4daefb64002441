"""Writing a sequence to an Alembic file, frame by frame."""

import math
import os
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Singles, Values
from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.alembic.attributes import (
    COMPUTED,
    NORMALS,
    SEGMENT_ATTRIBUTES,
    TRACK_KIND,
    UNIT,
    UVS,
    VELOCITIES,
)
from meshreel.formats.alembic.meshes import read_meshes
from meshreel.formats.frames.frame_stream import FrameStream, SegmentedStream
from meshreel.formats.frames.shared_data import SharedData
from meshreel.formats.kinds import OF_SURFACES, SequenceFormat
from meshreel.formats.options import WriteOptions
from meshreel.formats.scenes.parts import PartMesh, split_parts, unique_name
from meshreel.formats.scenes.transforms import Rounding
from meshreel.formats.surfaces.polygons import reversed_corners
from meshreel.model.geometry.hard_edges import RowNormals
from meshreel.model.notes import (
    Notes,
    note_name,
    note_track_type,
    note_unwritten_tracks,
    note_unwritten_units,
    written_rate,
    written_times,
)
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind
from meshreel.model.tracks import TrackKind, TrackSource, value_range
from meshreel.runtime.extras import ALEMBIC, IMATH

SAMPLE_OVERHEAD_BYTES = 256
"""Bound on the overhead of a part in a frame, in addition to its positions; 124 bytes measured."""
PART_OVERHEAD_BYTES = 1 << 14
"""Bound on headers and names of a part; about 1.5 kB measured."""

UNNAMED = "mesh"

IN_NAMES, IN_METADATA, IN_TEXTS = "/\0", ";=\0", "\0"
"""Reserved characters of path components, of metadata, and of strings.

The Alembic library aborts the process if the name of texture coordinates contains a reserved
character of metadata.
"""

SCOPES = {
    Domain.VERTEX: "kVertexScope",
    Domain.FACE: "kUniformScope",
    Domain.CORNER: "kFacevaryingScope",
}
NUMBER_TYPES = {
    "u1": ("Uchar", "Uchar"), "i1": ("Int32", "Int32"), "i2": ("Int32", "Int32"),
    "u2": ("Int32", "Int32"), "i4": ("Int32", "Int32"), "u4": ("UInt32", "Uint32"),
    "i8": ("Int64", "Int32"), "u8": ("UInt64", "Int32"), "f4": ("Float", "Float"),
    "f8": ("Double", "Double"),
}  # fmt: skip
"""The library's names of scalar property types and their array types, by NumPy type."""

STANDARD_NAMES = {
    TrackKind.NORMAL: NORMALS,
    TrackKind.VELOCITY: VELOCITIES,
    TrackKind.UV: UVS,
}
"""The standard mesh properties, which other programs read."""

UV_TYPE = "V2f", "V2f", 1
MAX_INT32 = np.iinfo(np.int32).max

ObjectPath = tuple[str, ...]
"""Names from the root down."""

PropertyType = tuple[str, str, int]
"""The library's names of a property type and of its array type, and the array extent."""


def clean(text: str, reserved: str) -> str:
    """Return the text with ``_`` in place of reserved characters and lone surrogates."""
    return "".join(
        "_" if char in reserved or "\ud800" <= char <= "\udfff" else char for char in text
    )


def clean_unique_name(name: str, used: set[str]) -> str:
    """Return the name without slashes, made unique, and add it to `used`."""
    return unique_name(clean(name, IN_NAMES) or UNNAMED, used)


def object_paths(names: Sequence[str]) -> list[ObjectPath]:
    """Return a path for each part, unique and below at least one transform.

    A part name that is a path becomes the path of its mesh. A path that has a single component,
    or is also the parent of another part, gains a transform of the same name, as in Blender:
    "body" becomes "/body/body".
    """
    requested = [
        tuple(clean(component, IN_NAMES) for component in name.split("/") if component)
        or (UNNAMED,)
        for name in names
    ]
    transforms = {path[:depth] for path in requested for depth in range(1, len(path))}
    transforms |= {path for path in requested if len(path) == 1}
    used = set(transforms)
    paths = []
    for path in requested:
        mesh_path = (*path, path[-1]) if path in transforms else path
        siblings = {other[-1] for other in used if other[:-1] == mesh_path[:-1]}
        paths.append((*mesh_path[:-1], clean_unique_name(mesh_path[-1], siblings)))
        used.add(paths[-1])
    return paths


def write_alembic(path: Path, stream: SegmentedStream, options: WriteOptions) -> None:
    """Write an Alembic file (Ogawa) with one polygon mesh per part.

    Float32 positions, polygons and attributes are lossless; notes name everything else. If the
    faces change, faces, attributes and groups are sampled in every frame. One frame is in memory
    at a time.

    Raises
    ------
    FormatError
        If the library is not installed, or cannot write the file.
    InvalidInputError
        If the disk is too small, or a position does not fit into float32.
    """
    shared = SharedData.of(stream.meshes())
    shared.note_others(".abc", stream.notes)
    stream = stream.changed(shared.only)
    check_free_space(path, stream)
    try:
        rounding = _write_archive(path, stream, shared)
    except RuntimeError as error:  # from the Alembic library
        raise FormatError(
            f"the Alembic library cannot write {path.name}: {' '.join(str(error).split())}"
        ) from None
    rounding.note(stream.notes)


def _write_archive(path: Path, stream: SegmentedStream, shared: SharedData) -> Rounding:
    """Write a file, which is complete once the library's objects are destroyed."""
    archive = ALEMBIC.load("Abc").OArchive(str(path))
    sampling = archive.addTimeSampling(_time_sampling(stream))
    left_out = unwritable_tracks(stream, shared)
    rounding: Rounding | None = None
    writers: list[_PartWriter] = []
    for segment in stream.segments():
        tracks = {name: track for name, track in segment.tracks.items() if name not in left_out}
        parts = list(split_parts(segment.faces, segment.surface, segment.n_verts, stream.name))
        if rounding is None:
            rounding = Rounding(segment.first, "Alembic")
            for part in parts:
                note_name("part", part.name, clean(part.name, IN_TEXTS), ".abc", stream.notes)
            segment_data = shared if stream.n_segments > 1 else None
            transforms: dict[ObjectPath, Any] = {(): archive.getTop()}
            for part, place in zip(parts, object_paths([p.name for p in parts]), strict=True):
                parent = _transform(transforms, place[:-1], rounding.shift)
                mesh = ALEMBIC.load("AbcGeom").OPolyMesh(parent, place[-1], sampling)
                schema = mesh.getSchema()
                writers.append(
                    _PartWriter(schema, part, sampling, tracks, segment.notes, segment_data)
                )
        for writer, part in zip(writers, parts, strict=True):
            writer.begin(part)
        for index, frame in enumerate(segment.frames()):
            rounded = rounding.add(frame)
            values = {name: track.read(index, index + 1)[0] for name, track in tracks.items()}
            for writer in writers:
                writer.add(rounded, values)
    assert rounding is not None  # there is at least one segment
    return rounding


def _time_sampling(stream: SegmentedStream) -> Any:
    core = ALEMBIC.load("AbcCoreAbstract")
    timing = stream.timing
    if timing.times is not None or (stream.n_frames == 1 and not timing.fps):
        times = core.TimeVector()
        for time in written_times(timing, stream.n_frames, stream.notes).tolist():
            times.append(time)
        return core.TimeSampling(core.TimeSamplingType(core.AcyclicFlag.kAcyclic), times)
    return core.TimeSampling(1 / written_rate(timing, stream.notes), timing.start_s)


def _transform(transforms: dict[ObjectPath, Any], path: ObjectPath, shift: Floats) -> Any:
    """Return the transform at a path, created if it is missing; those at the top are shifted."""
    if path not in transforms:
        geometry, parent = ALEMBIC.load("AbcGeom"), _transform(transforms, path[:-1], shift)
        transform, sample = geometry.OXform(parent, path[-1]), geometry.XformSample()
        if len(path) == 1 and shift.any():
            sample.setTranslation(_imath().V3d(*shift.tolist()))
        transform.getSchema().set(sample)
        transforms[path] = transform
    return transforms[path]


def unwritable_tracks(stream: SegmentedStream, shared: SharedData) -> set[str]:
    """Return the names of tracks that Alembic cannot store; notes of the stream name them."""
    long_names = {
        str(name) for name, *_, number_type, _ in shared.tracks if number_type[1:] in ("i8", "u8")
    }
    too_large = {
        name: None
        for mesh in (stream.meshes() if long_names else ())
        for name, track in mesh.tracks.items()
        if name in long_names
        and any((abs(limit) > MAX_INT32).any() for limit in value_range(track))
    }
    note_unwritten_tracks(
        too_large, ".abc", stream.notes, "integers beyond 32 bits (a limit of its library)"
    )
    return set(too_large)


class _PartWriter:
    """Writes the mesh of a part.

    Attributes and groups have a sample per frame if the sequence has several segments, otherwise
    one.

    Parameters
    ----------
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
        self._is_first = True
        self._params: dict[str | int, Any] = {}
        self._track_params: dict[str, Any] = {}
        self._face_sets: dict[str, Any] = {}
        self._face_set_names: set[str] = set()
        self._face_samples: list[tuple[Any, Any]] = []
        self._choose_standard(tracks, part)

    def _choose_standard(self, tracks: Mapping[str, TrackSource], part: PartMesh) -> None:
        """Choose the tracks that are standard properties, which are float32."""
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
            note_track_type(name, track.dtype, dtype, self._notes)
            if standard not in ("", UVS):
                note_name("track", name, standard.strip("."), ".abc", self._notes)
        units = {name: track.unit for name, track in self._standard.values()}
        note_unwritten_units(units, ".abc", self._notes)

    def begin(self, part: PartMesh) -> None:
        """Begin a segment with the part in it."""
        self._part, self._is_new = part, True
        self._shading: RowNormals | None = None
        self._corner_order = reversed_corners(part.counts)
        if self._has_normals:
            self._shading = part.edge_normals()

    def add(self, frame: Singles, values: Mapping[str, Values]) -> None:
        """Write the next frame, from positions of shape (V, 3) and track values of all parts."""
        sample = ALEMBIC.load("AbcGeom").OPolyMeshSchemaSample()
        sample.setPositions(library_array("V3f", frame[self._part.verts]))
        for standard, (name, track) in self._standard.items():
            part_values = self._part_values(track, values[name]).astype(np.float32)
            if standard == VELOCITIES:
                sample.setVelocities(library_array("V3f", part_values))
            elif standard == NORMALS:
                sample.setNormals(_param_sample("N3f", "V3f", track.domain, part_values))
            else:
                sample.setUVs(_param_sample("V2f", "V2f", track.domain, part_values))
        if self._shading is not None:
            normals = self._shading.of_frames(frame[np.newaxis, self._part.verts])[0]
            of_corner = self._shading.rows.of_corner[self._corner_order]
            single = normals.astype(np.float32)
            sample.setNormals(_param_sample("N3f", "V3f", Domain.CORNER, single, of_corner))
        if self._is_new:
            self._write_segment(sample)
        else:  # the library repeats the faces
            self._schema.set(sample)
            if self._segment_data is not None:
                for param in self._params.values():
                    param.setFromPrevious()
                for face_set, faces in self._face_samples:
                    face_set.set(faces)
        for name, track in self._param_tracks.items():
            self._write_track(name, track, self._part_values(track, values[name]))
        self._is_new = self._is_first = False

    def _part_values(self, track: TrackSource, values: Values) -> Values:
        """Return the values of this part, with corners in file order."""
        part_values = values[self._part.items[track.domain]]
        is_corner = track.domain is Domain.CORNER
        return part_values[self._corner_order] if is_corner else part_values

    def _write_segment(self, sample: Any) -> None:
        """Write the first sample of a segment, with its faces, attributes and groups."""
        counts, attributes = self._part.counts, self._part.surface.attributes
        sample.setFaceCounts(library_array("Int32", counts))
        sample.setFaceIndices(library_array("Int32", self._part.corners[self._corner_order]))
        texture = next((attribute for attribute in attributes if _is_texture(attribute)), None)
        if self._is_first:
            self._mark_first(texture)
        if texture is not None:
            sample.setUVs(self._attribute_sample(texture, UV_TYPE))
        self._schema.set(sample)
        other_attributes = [attribute for attribute in attributes if attribute is not texture]
        for number, attribute in enumerate(other_attributes):
            kind = _attribute_type(attribute)
            if self._is_first:
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
        if self._is_first and self._segment_data is not None:
            # Our reader makes no track of these properties; their names contain no "/".
            names = [*sorted(self._names), *([] if texture is None else [UVS])]
            self._mark(SEGMENT_ATTRIBUTES, "/".join(names))

    def _mark_first(self, texture: Attribute | None) -> None:
        """Name the texture coordinates and mark normals, which must precede the first sample."""
        what, name, names = "attribute", "", set(self._param_tracks)
        if texture is not None:
            name = texture.name
            names = {each.name for each in self._part.surface.attributes if each is not texture}
        elif UVS in self._standard:
            what, name = "track", self._standard[UVS][0]
        if texture is not None or UVS in self._standard:
            written_name = unique_name(clean(name, IN_METADATA), names)
            note_name(what, name, written_name, ".abc", self._notes)
            self._schema.setUVSourceName(written_name)
        if self._shading is not None:
            self._mark(COMPUTED, NORMALS)

    def _mark(self, name: str, text: str) -> None:
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
        return create(params, name, is_indexed, _scope(domain), kind[2], *arguments)

    def _attribute_sample(self, attribute: Attribute, kind: PropertyType) -> Any:
        """Return a sample of an attribute, with corners in file order."""
        values, indices = attribute.values, attribute.indices
        if kind[0] in ("V2f", "C3f", "C4f") and values.dtype != np.float32:
            is_bytes = attribute.kind is Kind.COLOR and values.dtype == np.uint8
            values = (values / 255 if is_bytes else values).astype(np.float32)
            if is_bytes or (values != attribute.values).any():
                dtype = attribute.values.dtype
                self._notes.changed(
                    f"{attribute.kind} {attribute.name!r} is written as float32, not {dtype}"
                )
        if attribute.domain is Domain.CORNER:
            order = self._corner_order
            values = values[order] if indices is None else values
            indices = None if indices is None else indices[order]
        return _param_sample(*kind[:2], attribute.domain, values, indices)

    def _write_texts(self, groups: FaceGroups) -> None:
        """Write groups as a text per face."""
        if groups.name not in self._params:
            name, kind = self._new_name("group", groups.name), ("String", "String", 1)
            self._params[groups.name] = self._param(name, Domain.FACE, kind, is_indexed=True)
        labels = [clean(label, IN_TEXTS) for label in groups.labels]
        for label, cleaned in zip(groups.labels, labels, strict=True):
            note_name("label", label, cleaned, ".abc", self._notes)
        empty = len(groups.labels)  # index of the empty text at the end
        numbers = np.where(groups.numbers < 0, empty, groups.numbers)
        sample = _param_sample("String", "String", Domain.FACE, [*labels, ""], numbers)
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
            is_valid = clean(name, IN_METADATA) == name
            # Readers show the source name if there is one.
            note_name("track", name, name if is_valid else written_name, ".abc", self._notes)
            unit = clean(track.unit, IN_METADATA)
            note_name("unit", track.unit, unit, ".abc", self._notes)
            entries = {
                TRACK_KIND: str(track.kind),
                "sourceName": name if is_valid else "",
                UNIT: unit,
            }
            self._track_params[name] = self._param(
                written_name, track.domain, kind, entries, is_indexed=False
            )
        if track.dtype == np.uint8 and track.kind is TrackKind.COLOR:
            values = values / 255
        values = values.astype(_written_type(track))
        self._track_params[name].set(_param_sample(*kind[:2], track.domain, values))


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
    if _is_color(track):
        return f"C{width}f", f"C{width}f", 1
    precision = {"f4": "f", "f8": "d"}.get(letter)
    if precision and (width == 3 or track.kind is TrackKind.UV):
        return f"V{width}{precision}", f"V{width}{precision}", 1
    return *NUMBER_TYPES[letter], width


def _is_color(track: TrackSource) -> bool:
    has_color_type = track.dtype.kind == "f" or track.dtype == np.uint8
    return track.kind is TrackKind.COLOR and has_color_type


def _written_type(track: TrackSource) -> np.dtype[Any]:
    """Return the number type of the geometry parameter in the file."""
    if _is_color(track):
        return np.dtype(np.float32)
    return np.dtype(np.int32) if track.dtype.str[1:] in ("i1", "i2", "u2") else track.dtype


def _param_sample(
    kind: str, array: str, domain: Domain, values: Any, indices: npt.NDArray[Any] | None = None
) -> Any:
    """Return a sample of a geometry parameter: values of a domain, and indices if any."""
    sample = getattr(ALEMBIC.load("AbcGeom"), f"O{kind}GeomParamSample")()
    sample.setVals(library_array(array, values))
    if indices is not None:
        sample.setIndices(library_array("Uint32", indices))
    sample.setScope(_scope(domain))
    return sample


def _scope(domain: Domain) -> Any:
    """Return the library's geometry scope of a domain."""
    return getattr(ALEMBIC.load("AbcGeom").GeometryScope, SCOPES[domain])


def library_array(kind: str, values: Any) -> Any:
    """Return a copy of values as an array of the Alembic library.

    Parameters
    ----------
    kind : str
        The library's name of the type: "V3f", "V2f", "C3f", "C4f", "Int32", "Uint32", "Float",
        "Double", "Uchar" or "String".
    values : array of shape (N,) or (N, C), or sequence of str
        Of a NumPy type that the kind can hold.
    """
    imath = _imath()
    if kind == "String":
        texts = imath.StringArray(len(values))
        for number, text in enumerate(values):
            texts[number] = text
        return texts
    if kind in ("C3f", "C4f"):
        colors = getattr(imath, f"{kind}Array")(len(values))
        for channel, column in zip("rgba", values.T, strict=False):
            np.asarray(getattr(colors, channel))[:] = column  # writes through a view
        return colors
    values = values if kind[0] == "V" else values.ravel()
    if kind == "Uint32":  # has no buffer interface; float64 is exact
        return imath.UnsignedIntArray(library_array("Double", values.astype(np.float64)))
    if kind == "Uchar":
        bytes_array = imath.UnsignedCharArray(len(values))
        np.asarray(bytes_array)[:] = values
        return bytes_array
    if kind == "Int32":  # 64-bit tracks have small values here
        kind, values = "Int", values.astype(np.int32, copy=False)
    return getattr(imath, f"{kind}ArrayFromBuffer")(np.ascontiguousarray(values))


def _imath() -> Any:
    imath = IMATH.load()
    if not hasattr(imath, "V3fArrayFromBuffer"):
        raise FormatError(
            "another package shadows the module imath of alembic3d; remove it with: "
            "pip uninstall imath; then: pip install --force-reinstall alembic3d"
        )
    return imath


def check_free_space(path: Path, stream: SegmentedStream) -> None:
    """Check that the disk has enough space: the library aborts the process on a full disk.

    The space is allocated once and freed, so that quotas and file size limits count too.

    Raises
    ------
    InvalidInputError
        If there is less space than the file may need.
    """
    max_bytes = sum(map(_max_file_bytes, stream.meshes()))
    try:
        if hasattr(os, "posix_fallocate"):
            with tempfile.TemporaryFile(dir=path.parent) as file:
                os.posix_fallocate(file.fileno(), 0, max_bytes)
        is_free, reason = shutil.disk_usage(path.parent).free >= max_bytes, "the disk is too full"
    except OSError as error:
        is_free, reason = False, str(error.strerror)
    if not is_free:
        raise InvalidInputError(
            f"{path.name} needs up to {max_bytes} bytes as an Alembic file, but there is not "
            f"enough space ({reason}); write it to another disk"
        )


def _max_file_bytes(mesh: FrameStream) -> int:
    """Return an upper bound on the size of a segment in an Alembic file."""
    surface = mesh.surface
    n_parts = max(1, len(surface.parts))
    n_corners = 3 * len(mesh.faces)
    constant_bytes = 4 * (n_corners + len(mesh.faces)) + 4 * surface.size_bytes
    n_numbers = sum(math.prod(track.shape[1:]) for track in mesh.tracks.values())
    n_sampled = len(surface.attributes) + sum(1 + len(group.labels) for group in surface.groups)
    n_arrays = n_parts * (1 + len(mesh.tracks) + n_sampled)
    if surface.hard_edges is not None:
        n_numbers += 3 * n_corners
    frame_bytes = 12 * mesh.n_verts + 8 * n_numbers + SAMPLE_OVERHEAD_BYTES * n_arrays
    return int(constant_bytes + frame_bytes * mesh.n_frames + PART_OVERHEAD_BYTES * n_arrays)


FORMATS = (
    SequenceFormat(
        ".abc",
        "Alembic",
        read_meshes=read_meshes,
        extra=ALEMBIC,
        reads_without_extra=True,
        write=write_alembic,
        holds_segments=True,
        holds_tracks=OF_SURFACES,
    ),
)
