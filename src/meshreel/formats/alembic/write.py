"""Valid and unique names and paths for the objects and properties of an Alembic file."""

import math
import os
import shutil
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values
from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.alembic.attributes import (
    COMPUTED,
    NORMALS,
    SEGMENT_ATTRIBUTES,
    TRACK_KIND,
    UNIT,
    VELOCITIES,
)
from meshreel.formats.alembic.winding import reversed_corners
from meshreel.formats.frames.segmented_stream import SegmentedStream, SegmentMesh
from meshreel.formats.frames.shared_data import SharedData
from meshreel.formats.notes import (
    note_name,
    note_track_name,
    note_track_type,
    note_unwritten_tracks,
    note_unwritten_units,
)
from meshreel.formats.options import WriteOptions
from meshreel.formats.scenes.parts import PartMesh, split_parts
from meshreel.formats.text.decimal_text import Narrowing
from meshreel.model.geometry.hard_edges import RowNormals
from meshreel.model.geometry.polygons import Integers
from meshreel.model.sequence import Vertices
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind
from meshreel.model.tracks import TrackKind, TrackSource, value_range
from meshreel.runtime.extras import ALEMBIC, IMATH

UNNAMED = "mesh"

IN_NAMES, IN_METADATA, IN_TEXTS = "/\0", ";=\0", "\0"
"""Reserved characters of path components, of metadata, and of strings.

The Alembic library aborts the process if the name of texture coordinates contains a reserved
character of metadata.
"""

ObjectPath = tuple[str, ...]
"""Names from the root down."""


def clean(text: str, reserved: str) -> str:
    """Return the text with ``_`` in place of reserved characters and lone surrogates."""
    return "".join("_" if one in reserved or "\ud800" <= one <= "\udfff" else one for one in text)


def clean_unique_name(name: str, used: Iterable[str]) -> str:
    """Return the name without slashes, with a number appended if it is in use."""
    return unique_name(clean(name, IN_NAMES) or UNNAMED, used)


def unique_name(name: str, used: Iterable[str]) -> str:
    """Return the name, with a number appended if it is in use."""
    unique, number = name, 1
    while unique in used:
        number += 1
        unique = f"{name}_{number}"
    return unique


def object_paths(names: Sequence[str]) -> list[ObjectPath]:
    """Return a path for each part, unique and below at least one transform.

    A part name that is a path becomes the path of its mesh. A path that has a single component,
    or is also the parent of another part, gains a transform of the same name, as in Blender:
    "body" becomes "/body/body".
    """
    requested = [
        tuple(clean(one, IN_NAMES) for one in name.split("/") if one) or (UNNAMED,)
        for name in names
    ]
    transforms = {path[:depth] for path in requested for depth in range(1, len(path))}
    transforms |= {path for path in requested if len(path) == 1}
    used = set(transforms)
    paths = []
    for path in requested:
        placed = (*path, path[-1]) if path in transforms else path
        siblings = {one[-1] for one in used if one[:-1] == placed[:-1]}
        name = clean_unique_name(placed[-1], siblings)
        paths.append((*placed[:-1], name))
        used.add(paths[-1])
    return paths


def library_array(kind: str, values: npt.NDArray[Any]) -> Any:
    """Return a copy of an array of shape (N,) or (N, C) as an array of the Alembic library.

    Parameters
    ----------
    kind : str
        The library's name of the type: "V3f", "V2f", "C3f", "C4f", "Int32", "Uint32", "Float",
        "Double" or "Uchar".
    values : array
        Of the NumPy type that corresponds to the kind.
    """
    imath = _imath()
    if kind == "Uint32":  # has no buffer interface; float64 is exact
        return imath.UnsignedIntArray(library_array("Double", values.astype(np.float64)))
    if kind in ("C3f", "C4f"):
        return _colors(getattr(imath, f"{kind}Array")(len(values)), values)
    if kind == "Uchar":
        bytes_array = imath.UnsignedCharArray(len(values))
        np.asarray(bytes_array)[:] = values
        return bytes_array
    name = {"Int32": "Int"}.get(kind, kind)
    return getattr(imath, f"{name}ArrayFromBuffer")(np.ascontiguousarray(values))


def text_array(texts: Sequence[str]) -> Any:
    """Return strings as a string array of the library."""
    array = _imath().StringArray(len(texts))
    for number, text in enumerate(texts):
        array[number] = text
    return array


def library_vector(values: npt.NDArray[np.float64]) -> Any:
    """Return a vector of shape (3,) as a vector of the library."""
    return _imath().V3d(*values.tolist())


def _colors(array: Any, values: npt.NDArray[np.float32]) -> Any:
    for channel, column in zip("rgba", values.T, strict=False):
        np.asarray(getattr(array, channel))[:] = column  # writes through a view
    return array


def _imath() -> Any:
    imath = IMATH.load()
    if not hasattr(imath, "V3fArrayFromBuffer"):
        raise FormatError(
            "another package shadows the module imath of alembic3d; remove it with: "
            "pip uninstall imath; then: pip install --force-reinstall alembic3d"
        )
    return imath


SCOPES = {
    Domain.VERTEX: "kVertexScope",
    Domain.FACE: "kUniformScope",
    Domain.CORNER: "kFacevaryingScope",
}
NUMBER_KINDS = {"uint8": "Uchar", "int32": "Int32", "float32": "Float", "float64": "Double"}
"""The library's names of scalar property types, by NumPy type."""


def is_texture(attribute: Attribute) -> bool:
    """Return whether an attribute is two-dimensional texture coordinates."""
    return attribute.kind is Kind.UV and attribute.values.shape[1] == 2


def texture_sample(attribute: Attribute, counts: Integers, notes: list[str]) -> Any:
    """Return texture coordinates as the UV sample of the first frame of a segment."""
    return _sample("V2f", attribute, _converted(attribute, "V2f", notes), counts)


class AttributeWriter:
    """Writes the attributes and groups of a mesh as geometry parameters and face sets.

    They have a sample per frame if the mesh has several segments, otherwise one.

    Parameters
    ----------
    schema : OPolyMeshSchema
        With a first sample.
    sampling : int or None
        Index of the time sampling of the parameters; None for one sample.
    labels : sequence of str
        Labels of the materials in all segments.
    names : set of str
        Names of the parameters so far; gains those of the attributes and groups.
    notes : list of str
        Gains a sentence for names and values that the file cannot store exactly.

    Attributes
    ----------
    names : list of str
        Names of the parameters.
    """

    def __init__(
        self,
        schema: Any,
        sampling: int | None,
        labels: Sequence[str],
        names: set[str],
        notes: list[str],
    ) -> None:
        self._schema, self._sampling, self._labels = schema, sampling, labels
        self._names, self._notes = names, notes
        self._params: list[Any] | None = None
        self._text_params: list[Any] | None = None
        self.names: list[str] = []
        self._face_sets: dict[str, Any] = {}
        self._face_set_names: set[str] = set()
        self._face_samples: list[tuple[Any, Any]] = []

    @property
    def is_sampled(self) -> bool:
        """Whether the parameters have a sample per frame."""
        return self._sampling is not None

    def write(
        self, attributes: Sequence[Attribute], groups: Sequence[FaceGroups], counts: Integers
    ) -> None:
        """Write the sample of the first frame of a segment.

        Parameters
        ----------
        attributes, groups
            The same in number, kind and order in all segments.
        counts : integer array
            Corners of each face.
        """
        texts = [one for one in groups if one.name != "material"]
        if self._params is None:
            self._params = [self._param(one) for one in attributes]
        for param, attribute in zip(self._params, attributes, strict=True):
            kind, _ = _attribute_kind(attribute)
            param.set(_sample(kind, attribute, _converted(attribute, kind, self._notes), counts))
        for one in groups:
            if one.name == "material":
                self._write_face_sets(one)
        if self._text_params is None:
            self._text_params = [self._text_param(one) for one in texts]
        for param, one in zip(self._text_params, texts, strict=True):
            param.set(self._text_sample(one))

    def repeat(self) -> None:
        """Repeat the last sample for a further frame of the segment."""
        if self._sampling is not None:
            for param in (*(self._params or ()), *(self._text_params or ())):
                param.setFromPrevious()
            for face_set, sample in self._face_samples:
                face_set.set(sample)

    def _param(self, attribute: Attribute) -> Any:
        self._names.add(name := clean_unique_name(attribute.name, self._names))
        note_name("attribute", attribute.name, name, ".abc", self._notes)
        kind, extent = _attribute_kind(attribute)
        self.names.append(name)
        return self._create(
            kind, name, attribute.domain, extent, is_indexed=attribute.indices is not None
        )

    def _text_param(self, groups: FaceGroups) -> Any:
        self._names.add(name := clean_unique_name(groups.name, self._names))
        note_name("group", groups.name, name, ".abc", self._notes)
        self.names.append(name)
        return self._create("String", name, Domain.FACE, 1, is_indexed=True)

    def _create(
        self, kind: str, name: str, domain: Domain, extent: int, *, is_indexed: bool
    ) -> Any:
        times = []
        if self._sampling is not None:
            times = [ALEMBIC.load("Abc").Argument(self._sampling)]
        create = getattr(ALEMBIC.load("AbcGeom"), f"O{kind}GeomParam")
        return create(
            self._schema.getArbGeomParams(), name, is_indexed, scope_of(domain), extent, *times
        )

    def _text_sample(self, groups: FaceGroups) -> Any:
        labels = [clean(label, IN_TEXTS) for label in groups.labels]
        for label, written in zip(groups.labels, labels, strict=True):
            note_name("label", label, written, ".abc", self._notes)
        none = len(groups.labels)  # the index of the empty text at the end
        numbers = np.where(groups.numbers < 0, none, groups.numbers)
        sample = ALEMBIC.load("AbcGeom").OStringGeomParamSample()
        sample.setVals(text_array([*labels, ""]))
        sample.setIndices(library_array("Uint32", numbers))
        sample.setScope(scope_of(Domain.FACE))
        return sample

    def _write_face_sets(self, groups: FaceGroups) -> None:
        geometry = ALEMBIC.load("AbcGeom")
        labels = groups.labels if self._sampling is None else self._labels
        self._face_samples = []
        for label in labels:
            if label not in self._face_sets:
                name = clean_unique_name(label, self._face_set_names)
                self._face_set_names.add(name)
                note_name("material", label, name, ".abc", self._notes)
                created = self._face_sets[label] = self._schema.createFaceSet(name).getSchema()
                if self._sampling is not None:
                    created.setTimeSampling(self._sampling)
            number = groups.labels.index(label) if label in groups.labels else -2
            faces = np.flatnonzero(groups.numbers == number).astype(np.int32)
            sample = geometry.OFaceSetSchemaSample()
            sample.setFaces(library_array("Int32", faces))
            self._face_sets[label].set(sample)
            self._face_samples.append((self._face_sets[label], sample))


def mark_attributes(schema: Any, names: Sequence[str]) -> None:
    """Mark properties that change only with the faces, so that our reader makes no track of them.

    Names of properties contain no "/".
    """
    mark = ALEMBIC.load("Abc").OStringProperty(schema.getUserProperties(), SEGMENT_ATTRIBUTES)
    mark.setValue("/".join(names))


def _attribute_kind(attribute: Attribute) -> tuple[str, int]:
    """Return the library's name of the property type, and its array extent."""
    width = attribute.values.shape[1]
    if is_texture(attribute):
        return "V2f", 1
    if attribute.kind is Kind.COLOR and width in (3, 4):
        return f"C{width}f", 1
    return NUMBER_KINDS[str(attribute.values.dtype)], width


def _converted(attribute: Attribute, kind: str, notes: list[str]) -> npt.NDArray[Any]:
    """Return the values in the number type of a property type."""
    values = attribute.values
    if kind not in ("V2f", "C3f", "C4f") or values.dtype == np.float32:
        return values
    is_bytes = attribute.kind is Kind.COLOR and values.dtype == np.uint8
    converted = (values / 255 if is_bytes else values).astype(np.float32)
    if is_bytes or (converted != values).any():
        note = f"{attribute.kind} {attribute.name!r} is written as float32, not {values.dtype}"
        notes.extend([note] if note not in notes else [])
    return converted


def _sample(kind: str, attribute: Attribute, values: npt.NDArray[Any], counts: Integers) -> Any:
    """Return a sample of values, and indices if any, with corners in file order."""
    sample = getattr(ALEMBIC.load("AbcGeom"), f"O{kind}GeomParamSample")()
    indices = attribute.indices
    if attribute.domain is Domain.CORNER:
        order = reversed_corners(counts)
        values = values[order] if indices is None else values
        indices = None if indices is None else indices[order]
    sample.setVals(library_array(kind, values if kind[0] in "VC" else values.ravel()))
    if indices is not None:
        sample.setIndices(library_array("Uint32", indices))
    sample.setScope(scope_of(attribute.domain))
    return sample


def scope_of(domain: Domain) -> Any:
    """Return the library's geometry scope of a domain."""
    return getattr(ALEMBIC.load("AbcGeom").GeometryScope, SCOPES[domain])


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
            kind, array, extent = _track_kind(track)
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


def _track_kind(track: TrackSource) -> tuple[str, str, int]:
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


ASSUMED_FPS = 24.0

SAMPLE_OVERHEAD_BYTES = 256
"""Bound on the overhead of a part in a frame, in addition to its positions; 124 bytes measured."""
PART_OVERHEAD_BYTES = 1 << 14
"""Bound on headers and names of a part; about 1.5 kB measured."""


class Rounding:
    """Rounds positions to float32 relative to a translation, and tracks the largest error.

    The translation is zero, unless float64 positions are so far from the origin that float32
    would move a vertex by more than a millionth of the model size: then it is the center of the
    first frame. Positions that are float32 stay exact.

    Parameters
    ----------
    first : float array of shape (V, 3)
        Positions of the first frame.

    Attributes
    ----------
    shift : float64 array of shape (3,)
        The translation, which the transform above the mesh must add.
    max_error : float
        Largest rounding error of a coordinate so far.
    """

    def __init__(self, first: Vertices) -> None:
        narrowing = Narrowing()
        narrowing.add(first)
        low, high = first.min(axis=0), first.max(axis=0)
        middle = (low / 2 + high / 2).astype(np.float64)  # halved first, to avoid overflow
        self.shift = np.zeros(3) if narrowing.is_harmless else middle
        self.max_error = 0.0

    def add(self, frame: Vertices) -> npt.NDArray[np.float32]:
        """Return the next frame rounded to float32, of shape (V, 3).

        Raises
        ------
        InvalidInputError
            If a position does not fit into float32.
        """
        if frame.dtype == np.float32:
            return frame.astype(np.float32, copy=False)
        with np.errstate(over="ignore"):
            rounded = (frame - self.shift).astype(np.float32)
        if not np.isfinite(rounded).all():
            raise InvalidInputError(
                f"Alembic stores positions as float32, up to {np.finfo(np.float32).max:.3g}; "
                f"got {np.abs(frame).max():.3g}; scale the model"
            )
        error = float(np.abs(frame - (rounded + self.shift)).max())
        self.max_error = max(self.max_error, error)
        return rounded

    def describe(self) -> str:
        """Return a sentence on the rounding error; empty if there was none."""
        if self.max_error == 0:
            return ""
        relative = ", relative to the center of the first frame" if self.shift.any() else ""
        return (
            f"Alembic stores positions as float32{relative}: "
            f"coordinates change by up to {self.max_error:.2g}"
        )


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
    stream.notes.extend([note] if (note := rounding.describe()) else [])


def _write_archive(path: Path, stream: SegmentedStream, shared: SharedData) -> Rounding:
    """Write a file, which is complete once the library's objects are destroyed."""
    archive = ALEMBIC.load("Abc").OArchive(str(path))
    sampling = archive.addTimeSampling(_time_sampling(stream))
    left_out = unwritable_tracks(stream, shared)
    rounding: Rounding | None = None
    writers: list[_PartWriter] = []
    for segment in stream.segments():
        tracks = {name: one for name, one in segment.tracks.items() if name not in left_out}
        parts = list(split_parts(segment.faces, segment.surface, segment.n_verts, stream.name))
        if rounding is None:
            rounding = Rounding(segment.first)
            transforms = _Transforms(archive.getTop(), rounding.shift)
            for one in parts:
                note_name("part", one.name, clean(one.name, IN_TEXTS), ".abc", stream.notes)
            places = object_paths([one.name for one in parts])
            changing = shared if stream.n_segments > 1 else None
            writers = [
                _PartWriter(
                    part,
                    transforms.above(place),
                    place[-1],
                    sampling,
                    tracks,
                    segment.notes,
                    changing,
                )
                for part, place in zip(parts, places, strict=True)
            ]
        for writer, part in zip(writers, parts, strict=True):
            writer.begin(part)
        for index, frame in enumerate(segment.frames()):
            rounded = rounding.add(frame)
            values = {name: one.read(index, index + 1)[0] for name, one in tracks.items()}
            for writer in writers:
                writer.add(rounded, values)
    assert rounding is not None  # there is at least one segment
    return rounding


def _time_sampling(stream: SegmentedStream) -> Any:
    core = ALEMBIC.load("AbcCoreAbstract")
    if stream.n_frames == 1 and not stream.fps:
        times = core.TimeVector()
        times.append(stream.start_s)
        return core.TimeSampling(core.TimeSamplingType(core.AcyclicFlag.kAcyclic), times)
    if not stream.fps:
        stream.notes.append(
            f"the frame rate is unknown; written as {ASSUMED_FPS:g} frames per second"
        )
    return core.TimeSampling(1 / (stream.fps or ASSUMED_FPS), stream.start_s)


class _Transforms:
    """The transforms of a file, created on demand.

    Parameters
    ----------
    top : OObject
    shift : float64 array of shape (3,)
        Translation of the transforms at the top.
    """

    def __init__(self, top: Any, shift: npt.NDArray[np.float64]) -> None:
        self._shift = shift
        self._created: dict[tuple[str, ...], Any] = {(): top}

    def above(self, place: tuple[str, ...]) -> Any:
        """Return the parent transform of an object, given the path of the object."""
        path = place[:-1]
        if path not in self._created:
            geometry = ALEMBIC.load("AbcGeom")
            transform, sample = geometry.OXform(self.above(path), path[-1]), geometry.XformSample()
            if len(path) == 1 and self._shift.any():
                sample.setTranslation(library_vector(self._shift))
            transform.getSchema().set(sample)
            self._created[path] = transform
        return self._created[path]


class _PartWriter:
    """Writes the mesh of a part.

    Parameters
    ----------
    part : PartMesh
        The part in the first segment.
    parent : OXform
    sampling : int
        Index of the time sampling of its positions.
    tracks : mapping of str to TrackSource
    notes : list of str
        Gains a sentence for everything that the file cannot store exactly.
    changing : SharedData, optional
        Data of all segments, if there are several: then faces and attributes are sampled.
    """

    def __init__(
        self,
        part: PartMesh,
        parent: Any,
        name: str,
        sampling: int,
        tracks: Mapping[str, TrackSource],
        notes: list[str],
        changing: SharedData | None,
    ) -> None:
        self._notes = notes
        self._names = set[str]()
        self._tracks = TrackWriter(part, tracks, sampling, self._names, notes)
        self._schema = ALEMBIC.load("AbcGeom").OPolyMesh(parent, name, sampling).getSchema()
        has_track = any(one.kind is TrackKind.NORMAL for one in tracks.values())
        has_hard_edges = part.surface.hard_edges is not None
        if changing is not None:
            has_hard_edges = changing.has_hard_edges
        self._has_normals = has_hard_edges and not has_track
        labels = changing.labels.get(("material",), ()) if changing is not None else ()
        attribute_sampling = None if changing is None else sampling
        self._attributes = AttributeWriter(
            self._schema, attribute_sampling, labels, self._names, notes
        )
        self._n_samples = 0

    def begin(self, part: PartMesh) -> None:
        """Begin a segment with the part in it."""
        self._part, self._is_new = part, True
        self._tracks.use(part)
        self._shading = None
        if self._has_normals:
            n_verts = part.verts.stop - part.verts.start
            hard_edges = part.surface.hard_edges
            self._shading = RowNormals(part.counts, part.corners, hard_edges, n_verts)

    def add(self, frame: npt.NDArray[np.float32], values: Mapping[str, Values]) -> None:
        """Write the next frame, from positions of shape (V, 3) and track values of all parts."""
        sample = ALEMBIC.load("AbcGeom").OPolyMeshSchemaSample()
        sample.setPositions(library_array("V3f", frame[self._part.verts]))
        self._tracks.add_standard(sample, values)
        if self._shading is not None:
            normals = self._shading.of_frames(frame[np.newaxis, self._part.verts])[0]
            of_corner = self._shading.rows.of_corner[reversed_corners(self._part.counts)]
            sample.setNormals(normal_sample(normals, of_corner))
        if self._is_new:
            self._write_faces(sample)
        else:  # the library repeats the faces
            self._schema.set(sample)
            self._attributes.repeat()
        self._tracks.add_others(self._schema, values)
        self._is_new = False
        self._n_samples += 1

    def _write_faces(self, sample: Any) -> None:
        """Write the first sample of a segment, with its faces and attributes."""
        counts, attributes = self._part.counts, self._part.surface.attributes
        corners = self._part.corners[reversed_corners(counts)]
        sample.setFaceCounts(library_array("Int32", counts))
        sample.setFaceIndices(library_array("Int32", corners))
        is_first = self._n_samples == 0
        texture = next((one for one in attributes if is_texture(one)), None)
        others = [one for one in attributes if one is not texture]
        if texture is not None:
            if is_first:
                name = unique_name(clean(texture.name, IN_METADATA), {one.name for one in others})
                note_name("attribute", texture.name, name, ".abc", self._notes)
                self._schema.setUVSourceName(name)
            sample.setUVs(texture_sample(texture, counts, self._notes))
        if is_first:
            self._tracks.begin(self._schema)
            if self._shading is not None:
                mark_computed(self._schema)
        self._schema.set(sample)
        self._attributes.write(others, self._part.surface.groups, counts)
        if is_first and self._attributes.is_sampled:
            names = [*self._attributes.names, *([] if texture is None else ["uv"])]
            mark_attributes(self._schema, names)


def check_free_space(path: Path, stream: SegmentedStream) -> None:
    """Check that the disk has enough space: the library aborts the process on a full disk.

    The space is allocated once and freed, so that quotas and file size limits count too.

    Raises
    ------
    InvalidInputError
        If there is less space than the file may need.
    """
    needed = sum(map(_max_file_bytes, stream.meshes()))
    try:
        if hasattr(os, "posix_fallocate"):
            with tempfile.TemporaryFile(dir=path.parent) as trial:
                os.posix_fallocate(trial.fileno(), 0, needed)
        is_free, reason = shutil.disk_usage(path.parent).free >= needed, "the disk is too full"
    except OSError as error:
        is_free, reason = False, str(error.strerror)
    if not is_free:
        raise InvalidInputError(
            f"{path.name} needs up to {needed} bytes as an Alembic file, but there is not enough "
            f"space ({reason}); write it to another disk"
        )


def _max_file_bytes(mesh: SegmentMesh) -> int:
    """Return an upper bound on the size of a segment in an Alembic file."""
    surface = mesh.surface
    n_parts = max(1, len(surface.parts))
    n_corners = 3 * len(mesh.faces)
    once = 4 * (n_corners + len(mesh.faces)) + 4 * surface.size_bytes
    n_numbers = sum(math.prod(one.shape[1:]) for one in mesh.tracks.values())
    n_sampled = len(surface.attributes) + sum(1 + len(one.labels) for one in surface.groups)
    n_arrays = n_parts * (1 + len(mesh.tracks) + n_sampled)
    if surface.hard_edges is not None:
        n_numbers += 3 * n_corners
    per_frame = 12 * mesh.n_verts + 8 * n_numbers + SAMPLE_OVERHEAD_BYTES * n_arrays
    return int(once + per_frame * mesh.n_frames + PART_OVERHEAD_BYTES * n_arrays)
