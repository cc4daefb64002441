"""Texture coordinates, colors, other geometry parameters and face groups of an Alembic mesh."""

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values
from meshreel.formats.alembic.archive import Property, Times, bracketing_samples, damage_error
from meshreel.formats.alembic.winding import reversed_corners
from meshreel.formats.frames.field_tracks import NORMALS as NORMALS_ROLE
from meshreel.formats.frames.field_tracks import Field, Key, field_tracks
from meshreel.formats.frames.stored_frames import changed_error
from meshreel.formats.notes import UNCHANGING, note_kinds, note_left_out, note_moving
from meshreel.formats.scenes.merging import BLENDED
from meshreel.formats.scenes.vector_transforms import Matrix, transform_normals, transform_vectors
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.surface import (
    MAX_COMPONENTS,
    VALUE_TYPES,
    Attribute,
    Domain,
    FaceGroups,
    Kind,
    Surface,
)
from meshreel.model.tracks import NUMBER_TYPES, TrackKind, TrackSource

DOMAINS = {"vtx": Domain.VERTEX, "var": Domain.VERTEX, "uni": Domain.FACE, "fvr": Domain.CORNER}
"""Domains by Alembic's name of the geometry scope."""
VALUES, INDICES = ".vals", ".indices"

NORMALS, VELOCITIES = "N", ".velocities"
"""Names of mesh properties."""

COMPUTED = "meshreel:computed"
"""User property that marks normals computed by meshreel from faces and hard edges, not a track."""

SEGMENT_ATTRIBUTES = "meshreel:attributes"
"""User property with the names, joined by "/", of properties that change only with the faces."""

NO_GROUP = ""
"""Label of faces without a group."""

Properties = Mapping[str, Property]


@dataclass(frozen=True, eq=False)
class GeometryParam:
    """A geometry parameter at a time: values, possibly indexed.

    Parameters
    ----------
    source : Property
        The values, or a compound of values and indices.
    """

    source: Property
    time_s: float

    @property
    def name(self) -> str:
        """Its source name if declared, as texture coordinates often do, or its property name."""
        return self.source.header.metadata.get("sourceName") or self.source.header.name

    @property
    def domain(self) -> Domain | None:
        """The domain of the values; None for a single value per mesh."""
        return DOMAINS.get(self.source.header.metadata.get("geoScope", ""))

    @property
    def width(self) -> int:
        """Components of a value, which may span several values of the file."""
        packed = self.source.header.metadata.get("arrayExtent", "")
        return self._values.header.extent * (int(packed) if packed.isdecimal() else 1)

    @property
    def kind(self) -> Kind:
        """The kind of attribute that it becomes."""
        header = self._values.header
        interpretation = header.metadata.get("interpretation", "")
        is_float = header.dtype is not None and header.dtype.kind == "f"
        if interpretation in ("rgb", "rgba") and self.width == len(interpretation):
            return Kind.COLOR if is_float or header.dtype == np.uint8 else Kind.OTHER
        return Kind.UV if is_float and self.width == header.extent == 2 else Kind.OTHER

    @property
    def is_text(self) -> bool:
        """Whether the values are strings."""
        return self._values.header.is_text

    @property
    def is_constant(self) -> bool:
        """Whether neither values nor indices change over time."""
        return self._values.is_constant and (self._indices is None or self._indices.is_constant)

    def numbers(self) -> npt.NDArray[Any] | None:
        """Return the values, of shape (N, width), in an attribute type; None if all lose bits."""
        if self._values.header.dtype is None or self.width == 0:
            return None
        numbers = self._values.numbers(self._sample(self._values)).ravel()
        if len(numbers) % self.width:
            raise damage_error(
                f"{self.name} has {len(numbers)} numbers, not a multiple of {self.width}"
            )
        return _as_attribute_type(numbers.reshape(-1, self.width))

    def item_values(self) -> npt.NDArray[Any] | None:
        """Return the values with indices applied, of shape (N, width); None if not numeric."""
        if self._values.header.dtype is None or self.width == 0:
            return None
        numbers = self._values.numbers(self._sample(self._values)).ravel()
        if numbers.dtype == np.float16:
            numbers = numbers.astype(np.float32)
        if len(numbers) == 0 or len(numbers) % self.width:
            return None
        values = numbers.astype(numbers.dtype.newbyteorder("=")).reshape(-1, self.width)
        indices = self.indices(len(values))
        return values if indices is None else values[indices]

    @property
    def times_s(self) -> Times:
        """Times at which values or indices are sampled, ascending."""
        own = [self._values.times_s]
        times = own if self._indices is None else [*own, self._indices.times_s]
        animated = [one for one in times if len(one) > 1]
        return np.unique(np.concatenate(animated)) if animated else times[0][:1]

    def metadata(self, key: str) -> str:
        """Return an entry of the metadata; empty if there is none."""
        return self.source.header.metadata.get(key, "")

    @property
    def interpretation(self) -> str:
        """The declared interpretation of the numbers: "vector", "normal" and others."""
        return self._values.header.metadata.get("interpretation", "")

    def texts(self) -> list[str]:
        """Return the values as strings."""
        return self._values.texts(self._sample(self._values))

    def indices(self, n_values: int) -> npt.NDArray[np.int32] | None:
        """Return the value index of each item, of shape (N,); None if not indexed."""
        if self._indices is None:
            return None
        indices = self._indices.integers(self._sample(self._indices))
        if len(indices) and not 0 <= indices.min() <= indices.max() < n_values:
            raise damage_error(f"{self.name} has indices beyond its {n_values} values")
        return indices.astype(np.int32)

    @property
    def _values(self) -> Property:
        return self.source.properties.get(VALUES, self.source)

    @property
    def _indices(self) -> Property | None:
        return self.source.properties.get(INDICES)

    def _sample(self, values: Property) -> int:
        return bracketing_samples(values.times_s, self.time_s)[0]


def _as_attribute_type(numbers: npt.NDArray[Any]) -> npt.NDArray[Any] | None:
    """Return numbers in a type that an attribute may have; None for integers beyond 32 bits."""
    if numbers.dtype in VALUE_TYPES:
        return numbers
    if numbers.dtype.kind == "f":
        return numbers.astype(np.float32)
    integers = numbers.astype(np.int32)
    return integers if (integers == numbers).all() else None


def read_attributes(
    geometry: Properties,
    mesh: PolygonMesh,
    time_s: float,
    notes: list[str],
    animated: Collection[str] = (),
) -> Surface:
    """Return the attributes and face groups of a mesh at a time.

    Numeric properties become attributes, and strings per face become groups. Strings that change
    over time are not supported.

    Parameters
    ----------
    geometry : dict of Property
        Properties of the mesh.
    mesh : PolygonMesh
        The mesh, with counterclockwise faces.
    notes : list of str
        Gains a sentence for properties that are left out.
    animated : collection of str, optional
        Names of properties that are read as tracks, and skipped here.
    """
    uvs = [geometry["uv"]] if "uv" in geometry else []
    other = geometry[".arbGeomParams"].properties if ".arbGeomParams" in geometry else {}
    attributes: list[Attribute] = []
    groups: list[FaceGroups] = []
    changing, constants, unsupported = (list[str]() for _ in range(3))
    marked = segment_attributes(geometry)
    for source in [*uvs, *other.values()]:
        param = GeometryParam(source, time_s)
        if source.header.name in animated:
            continue
        if param.domain is None and source not in uvs:
            constants.append(param.name)
        elif (attribute := _attribute(param, mesh)) is not None:
            attributes.append(attribute)
        elif (param.is_constant or source.header.name in marked) and (
            face_groups := _groups(param, mesh)
        ) is not None:
            groups.append(face_groups)
        else:
            (unsupported if param.is_constant else changing).append(param.name)
    note_moving(notes, changing)
    if VELOCITIES in geometry and VELOCITIES not in animated:
        note_kinds(notes, UNCHANGING, ["velocities"])
    note_kinds(notes, "values for a whole mesh", constants)
    note_kinds(notes, "properties that are neither numeric nor a text per face", unsupported)
    return Surface(attributes=tuple(attributes), groups=tuple(groups))


def segment_attributes(geometry: Properties) -> frozenset[str]:
    """Return the names of properties that change only with the faces, if meshreel wrote them."""
    user = geometry.get(".userProperties")
    found = user.properties.get(SEGMENT_ATTRIBUTES) if user is not None else None
    return frozenset("".join(found.texts()[:1]).split("/")) if found is not None else frozenset()


def read_normals(
    geometry: Properties, mesh: PolygonMesh, time_s: float
) -> npt.NDArray[np.floating] | None:
    """Return the corner normals at a time, of shape (C, 3), or None if the mesh has no normals.

    Normals whose count does not fit the mesh are read as zero.

    Parameters
    ----------
    geometry, mesh, time_s
        As in `read_attributes`.
    """
    if NORMALS not in geometry:
        return None
    param = GeometryParam(geometry[NORMALS], time_s)
    values = param.item_values()
    if values is None or values.shape[1] != 3 or values.dtype.kind != "f":
        return np.zeros((len(mesh.corners), 3))
    domain = domain_of(param.domain, len(values), mesh)
    if domain is Domain.CORNER:
        return values[reversed_corners(mesh.counts)]
    if domain is Domain.FACE:
        return np.repeat(values, mesh.counts, axis=0)
    return np.zeros((len(mesh.corners), 3)) if domain is None else values[mesh.corners]


def read_face_sets(
    face_sets: Mapping[str, Properties], n_faces: int, time_s: float
) -> tuple[FaceGroups, ...]:
    """Return the face sets as materials, for which most programs use them.

    A face set that overlaps an earlier one becomes a separate group.

    Raises
    ------
    FormatError
        If a face set refers to a face that does not exist.
    """
    materials = np.full(n_faces, -1, np.int32)
    labels: list[str] = []
    overlapping = []
    for name, properties in face_sets.items():
        faces = _face_indices(properties, name, n_faces, time_s)
        if not len(faces) and not properties[".faces"].is_constant:
            continue  # a material of other segments
        if (materials[faces] >= 0).any():
            numbers = np.full(n_faces, -1, np.int32)
            numbers[faces] = 0
            overlapping.append(FaceGroups(name, (name,), numbers))
        else:
            materials[faces] = len(labels)
            labels.append(name)
    return (FaceGroups("material", tuple(labels), materials), *overlapping) if labels else ()


def _attribute(param: GeometryParam, mesh: PolygonMesh) -> Attribute | None:
    if param.width > MAX_COMPONENTS:
        return None
    if (values := param.numbers()) is None:
        return None
    indices = param.indices(len(values))
    domain = domain_of(param.domain, len(values) if indices is None else len(indices), mesh)
    if domain is Domain.CORNER:
        order = reversed_corners(mesh.counts)
        values, indices = (values[order], None) if indices is None else (values, indices[order])
    return None if domain is None else Attribute(param.name, param.kind, domain, values, indices)


def domain_of(declared: Domain | None, n_values: int, mesh: PolygonMesh) -> Domain | None:
    """Return the declared domain if the number of values fits it, or else one that it fits."""
    n_items = {
        Domain.VERTEX: len(mesh.vertices),
        Domain.CORNER: len(mesh.corners),
        Domain.FACE: len(mesh.counts),
    }
    candidates = [*([declared] if declared else []), *n_items]
    return next((one for one in candidates if n_items[one] == n_values), None)


def _groups(param: GeometryParam, mesh: PolygonMesh) -> FaceGroups | None:
    if not (param.is_text and param.domain is Domain.FACE):
        return None
    texts = param.texts()
    indices = param.indices(len(texts))
    rows = np.arange(len(texts)) if indices is None else indices
    if len(rows) != len(mesh.counts):
        return None
    distinct = [text for text in dict.fromkeys(texts) if text != NO_GROUP]
    labels = {text: number for number, text in enumerate(distinct)}
    numbers = [labels.get(text, -1) for text in texts]
    return FaceGroups(param.name, tuple(labels), np.array(numbers, np.int32)[rows])


def _face_indices(
    properties: Properties, name: str, n_faces: int, time_s: float
) -> npt.NDArray[np.int64]:
    if (face_property := properties.get(".faces")) is None:
        raise damage_error(f"the face set {name} lacks .faces")
    if face_property.header.n_samples == 0:
        return np.zeros(0, np.int64)
    faces = face_property.integers(bracketing_samples(face_property.times_s, time_s)[0])
    if len(faces) and not 0 <= faces.min() <= faces.max() < n_faces:
        raise damage_error(f"the face set {name} refers to faces outside 0..{n_faces - 1}")
    return faces


TRACK_KIND, UNIT = "meshreelKind", "unit"
"""Metadata keys of properties that meshreel writes for tracks."""

UNSUPPORTED = "properties that do not fit the mesh or are not numeric"


@dataclass(frozen=True, eq=False)
class _AnimatedProperty:
    """A property that changes over time, and the track that it becomes.

    Parameters
    ----------
    name : str
        Name of the track.
    kind : str
        Kind of the track if declared, otherwise empty.
    role : str, optional
        `NORMALS_ROLE` if the values are normals.
    to_world : function of values and a matrix, optional
        Transforms the values with the mesh.
    """

    source: Property
    name: str
    kind: str
    role: str = ""
    to_world: Callable[[Values, Matrix], Values] | None = None

    @property
    def domain(self) -> Domain | None:
        """The declared domain of the values."""
        if self.source.header.name == VELOCITIES:
            return Domain.VERTEX
        return self._param(0.0).domain

    @property
    def unit(self) -> str:
        return self._param(0.0).metadata(UNIT)

    @property
    def times_s(self) -> Times:
        """Times at which it is sampled."""
        return self._param(0.0).times_s

    def values(self, time_s: float) -> Values | None:
        """Return the values of all items at a time, of shape (N, C); None if not numeric."""
        before, after, weight = bracketing_samples(self.times_s, time_s)
        first = self._param(float(self.times_s[before])).item_values()
        if first is None or first.dtype not in NUMBER_TYPES:
            return None
        is_interpolated = not self.kind or self.kind in BLENDED
        if weight == 0 or not is_interpolated or self.role or first.dtype.kind != "f":
            return first
        second = self._param(float(self.times_s[after])).item_values()
        if second is None or second.shape != first.shape:
            return first
        with np.errstate(all="ignore"):
            blend: Values = (1 - weight) * first.astype(np.float64) + weight * second
        return blend.astype(first.dtype)

    def _param(self, time_s: float) -> GeometryParam:
        return GeometryParam(self.source, time_s)


@dataclass(frozen=True, eq=False)
class MeshTracks:
    """The animated properties of a mesh, as tracks.

    Parameters
    ----------
    geometry : dict of Property
        Properties of the mesh.
    notes : list of str
        Gains a sentence for properties that are not read.
    """

    path: str
    geometry: Properties
    notes: list[str] = field(repr=False)

    @cached_property
    def properties(self) -> dict[str, _AnimatedProperty]:
        """The animated properties by property name, each with a unique track name."""
        animated_properties: dict[str, _AnimatedProperty] = {}
        used: set[str] = set()
        for one in self._candidates():
            name = one.name
            while name in used:
                name += "_"
            used.add(name)
            if name != one.name:
                self.notes.append(
                    f"{self.path} has {one.name!r} twice; the second is called {name!r}"
                )
            animated_properties[one.source.header.name] = replace(one, name=name)
        return animated_properties

    @property
    def times_s(self) -> list[Times]:
        """Sample times of each animated property."""
        return [one.times_s for one in self.properties.values()]

    def tracks(
        self,
        times_s: Times,
        mesh: PolygonMesh,
        world: Callable[[float], Matrix],
        all_times_s: Times,
        *,
        is_transform_animated: bool,
    ) -> Mapping[str, TrackSource]:
        """Return the tracks over a range of frames.

        Parameters
        ----------
        times_s : float64 array
            Times of the frames.
        mesh : PolygonMesh
            The mesh, whose faces are the same in these frames.
        world : function of a time
            Returns the world matrix.
        all_times_s : float64 array
            Times of all frames of the mesh.
        is_transform_animated : bool
            Whether the world matrix changes.
        """
        if not self.properties:
            return {}
        self._note(all_times_s, is_transform_animated=is_transform_animated)
        fitting = dict(self._fitting(times_s, mesh))
        counts = len(mesh.vertices), len(mesh.counts), len(mesh.corners)
        sizes = dict(zip(Domain, counts, strict=True))
        order = reversed_corners(mesh.counts)

        def values_of(key: Key, time_s: float) -> Values | None:
            one = fitting[key]
            values = one.values(time_s)
            if values is None or len(values) != sizes[key[0]]:
                return None
            values = values[order] if key[0] is Domain.CORNER else values
            return values if one.to_world is None else one.to_world(values, world(time_s))

        def read(index: int, key: Key) -> Values:
            if (values := values_of(key, float(times_s[index]))) is None:
                raise changed_error(f"{self.path} (frame {index})")
            return values

        frames: list[dict[Key, Field]] = []
        for time_s in times_s.tolist():
            fields: dict[Key, Field] = {}
            for key, one in fitting.items():
                if (values := values_of(key, time_s)) is not None:
                    fields[key] = Field(values.dtype, values.shape[1], one.role, one.kind, one.unit)
            frames.append(fields)
        return field_tracks(frames, sizes, read, self.notes)

    def _candidates(self) -> Iterator[_AnimatedProperty]:
        others = (
            self.geometry[".arbGeomParams"].properties if ".arbGeomParams" in self.geometry else {}
        )
        uvs = [self.geometry["uv"]] if "uv" in self.geometry else []
        marked = segment_attributes(self.geometry)
        for source in [*uvs, *others.values()]:
            if source.header.name in marked:
                continue
            param = GeometryParam(source, 0.0)
            declared = param.metadata(TRACK_KIND)
            is_single = param.domain is None and source not in uvs
            if is_single or param.is_text or (param.is_constant and not declared):
                continue
            kind = declared or ("" if param.kind is Kind.OTHER else str(param.kind))
            role = NORMALS_ROLE if param.interpretation == "normal" else ""
            yield _AnimatedProperty(source, param.name, kind, role)
        user = self.geometry.get(".userProperties")
        is_computed = user is not None and COMPUTED in user.properties
        if NORMALS in self.geometry and not (is_computed or _is_constant(self.geometry[NORMALS])):
            yield _AnimatedProperty(
                self.geometry[NORMALS], NORMALS, "", NORMALS_ROLE, transform_normals
            )
        if VELOCITIES in self.geometry and not self.geometry[VELOCITIES].is_constant:
            source, name = self.geometry[VELOCITIES], VELOCITIES.strip(".")
            yield _AnimatedProperty(source, name, TrackKind.VELOCITY, "", transform_vectors)

    def _fitting(
        self, times_s: Times, mesh: PolygonMesh
    ) -> Iterator[tuple[Key, _AnimatedProperty]]:
        """Yield the properties that fit the mesh at some time, by domain and name."""
        unsupported = []
        for one in self.properties.values():
            for time_s in times_s.tolist():
                values = one.values(time_s)
                domain = None if values is None else domain_of(one.domain, len(values), mesh)
                if domain is not None:
                    yield (domain, one.name), one
                    break
            else:
                unsupported.append(one.name)
        note_kinds(self.notes, UNSUPPORTED, unsupported)

    def _note(self, frames_s: Times, *, is_transform_animated: bool) -> None:
        """Note samples without a frame, and the velocity of animated transforms."""
        names = []
        for one in self.properties.values():
            times = one.times_s
            n_other = sum(not _is_at(frames_s, time_s) for time_s in times.tolist())
            if n_other and len(times) > 1:
                names.append(f"{one.name} ({n_other} of {len(times)})")
        note_kinds(self.notes, "samples where positions have no frame", names)
        if is_transform_animated and VELOCITIES in self.properties:
            note_left_out(self.notes, f"velocity of the transforms above {self.path}")


def _is_constant(values: Property) -> bool:
    return GeometryParam(values, 0.0).is_constant


def _is_at(frames_s: Times, time_s: float) -> bool:
    """Return whether there is a frame at a time."""
    before, _, weight = bracketing_samples(frames_s, time_s)
    margin = 1e-3 * float(frames_s[-1] - frames_s[0]) / max(1, len(frames_s) - 1)
    return weight == 0 and abs(float(frames_s[before]) - time_s) <= margin
