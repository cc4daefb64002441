"""Texture coordinates, colors and other geometry parameters of an Alembic mesh, and face groups.

Parameters that never change become attributes or groups, the others tracks; notes name properties
that are neither.
"""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Values
from meshreel.errors import FormatError
from meshreel.formats.alembic.archive import AbcObject, Property, damage_error
from meshreel.formats.frames.field_tracks import NORMALS as NORMALS_ROLE
from meshreel.formats.scenes.merging import BLENDED
from meshreel.formats.scenes.quantities import Quantity, normals_of_corners
from meshreel.formats.scenes.timing import blend, neighbors
from meshreel.formats.scenes.transforms import transform_normals, transform_vectors
from meshreel.formats.surfaces.polygons import PolygonMesh, reversed_corners
from meshreel.model.colors import to_srgb
from meshreel.model.notes import Notes
from meshreel.model.surface import (
    MAX_COMPONENTS,
    VALUE_TYPES,
    Attribute,
    Domain,
    FaceGroups,
    Kind,
    Surface,
)
from meshreel.model.tracks import NUMBER_TYPES, TrackKind

DOMAINS = {"vtx": Domain.VERTEX, "var": Domain.VERTEX, "uni": Domain.FACE, "fvr": Domain.CORNER}
"""Domains by Alembic's name of the geometry scope."""
VALUES, INDICES, FACES = ".vals", ".indices", ".faces"

NORMALS, VELOCITIES, UVS, PARAMS = "N", ".velocities", "uv", ".arbGeomParams"
"""Names of mesh properties."""

USER = ".userProperties"
"""Name of the compound of properties that programs add."""

COMPUTED = "meshreel:computed"
"""User property that marks normals computed by meshreel from faces and hard edges, not a track."""

SEGMENT_ATTRIBUTES = "meshreel:attributes"
"""User property with the names, joined by "/", of properties that change only with the faces."""

TRACK_KIND, UNIT = "meshreelKind", "unit"
"""Metadata keys of properties that meshreel writes for tracks."""

BOOKKEEPING = {
    ".selfBnds": "bounds, which programs compute",
    ".childBnds": "likewise",
    ".animChans": "which channels of a transform change",
    "isNotConstantIdentity": "whether a transform moves anything",
    ".facesExclusive": "whether face sets overlap",
    "samples": "number of samples of a time sampling",
    "statistics": "number of objects",
}
"""Properties without content of their own, and why."""

MISFITS = "properties that do not fit the faces"
"""Subject of the note on values whose number fits no domain of a mesh."""

Properties = Mapping[str, Property]


@dataclass(frozen=True, eq=False)
class GeometryParam:
    """A geometry parameter: values, possibly indexed."""

    source: Property
    """The values, or a compound of values and indices."""

    @property
    def values(self) -> Property:
        """The values, without indices."""
        return self.source.properties.get(VALUES, self.source)

    @property
    def indices(self) -> Property | None:
        """The value index of each item, if indexed."""
        return self.source.properties.get(INDICES)

    @property
    def name(self) -> str:
        """Its source name if declared, as texture coordinates often do, or its property name."""
        return self.source.metadata.get("sourceName") or self.source.name

    @property
    def domain(self) -> Domain | None:
        """The declared domain of the values; None for a single value per mesh."""
        if self.source.name == VELOCITIES:
            return Domain.VERTEX
        return DOMAINS.get(self.source.metadata.get("geoScope", ""))

    @property
    def width(self) -> int:
        """Components of a value, which may span several values of the file."""
        array_extent = self.source.metadata.get("arrayExtent", "")
        return self.values.extent * (int(array_extent) if array_extent.isdecimal() else 1)

    @property
    def interpretation(self) -> str:
        """The declared interpretation of the numbers: "vector", "normal" and others."""
        return self.values.metadata.get("interpretation", "")

    @property
    def kind(self) -> Kind:
        """The kind of attribute that it becomes."""
        dtype, width = self.values.dtype, self.width
        is_float = dtype is not None and dtype.kind == "f"
        if self.interpretation in ("rgb", "rgba") and width == len(self.interpretation):
            return Kind.COLOR if is_float or dtype == np.uint8 else Kind.OTHER
        return Kind.UV if is_float and width == self.values.extent == 2 else Kind.OTHER

    @property
    def is_constant(self) -> bool:
        """Whether neither values nor indices change over time."""
        return self.values.is_constant and (self.indices is None or self.indices.is_constant)

    def numbers(self, time_s: float) -> Values | None:
        """Return the values at a time, of shape (N, width); None if not numeric or incomplete."""
        if self.values.dtype is None or self.width == 0:
            return None
        numbers = self.values.numbers(_sample_index(self.values, time_s)).ravel()
        if len(numbers) % self.width:
            return None
        is_half = numbers.dtype == np.float16
        dtype = np.dtype(np.float32) if is_half else numbers.dtype.newbyteorder("=")
        values: Values = numbers.astype(dtype).reshape(-1, self.width)
        # Houdini writes linear colors; Blender and VTK write sRGB.
        is_linear = self.source.archive.application.startswith("Houdini")
        if is_linear and self.kind is Kind.COLOR and dtype.kind == "f":
            values = to_srgb(values).astype(dtype)
        return values

    def rows(self, time_s: float, n_values: int) -> npt.NDArray[np.int32] | None:
        """Return the value index of each item at a time, of shape (N,); None if not indexed."""
        if self.indices is None:
            return None
        indices = self.indices.integers(_sample_index(self.indices, time_s))
        if len(indices) and not 0 <= indices.min() <= indices.max() < n_values:
            raise damage_error(f"{self.name} has indices beyond its {n_values} values")
        return indices.astype(np.int32)

    def item_values(self, time_s: float) -> Values | None:
        """Return the values at a time with indices applied, of shape (N, width), or None."""
        values = self.numbers(time_s)
        if values is None or not len(values):
            return None
        rows = self.rows(time_s, len(values))
        return values if rows is None else values[rows]

    def times_s(self) -> Floats:
        """Return the times at which values or indices are sampled, ascending."""
        times = [self.values.times_s]
        times += [] if self.indices is None else [self.indices.times_s]
        animated = [time for time in times if len(time) > 1]
        return np.unique(np.concatenate(animated)) if animated else times[0][:1]

    def quantity(
        self,
        name: str,
        kind: str,
        role: str,
        to_world: Callable[[Values, Floats], Values] | None = None,
    ) -> Quantity:
        """Return the parameter as a quantity, interpolated between samples if its kind allows."""
        times, unit = self.times_s(), self.source.metadata.get(UNIT, "")
        is_blended = not role and (not kind or kind in BLENDED)

        def values(time_s: float) -> Values | None:
            before, after, weight = neighbors(times, time_s)
            first = self.item_values(float(times[before]))
            if first is None or first.dtype not in NUMBER_TYPES:
                return None
            if weight == 0 or not is_blended or first.dtype.kind != "f":
                return first
            second = self.item_values(float(times[after]))
            if second is None or second.shape != first.shape:
                return first
            return blend(first, second, weight)

        return Quantity(
            name, self.domain, values, lambda: times, kind, role, unit, to_world=to_world
        )


def _sample_index(values: Property, time_s: float) -> int:
    """Return the index of the sample in effect at a time."""
    return neighbors(values.times_s, time_s).before


def geometry_params(geometry: Properties) -> list[GeometryParam]:
    """Return the texture coordinates and other parameters of a mesh, in file order."""
    uvs = [geometry[UVS]] if UVS in geometry else []
    params = geometry[PARAMS].properties.values() if PARAMS in geometry else ()
    return [GeometryParam(source) for source in (*uvs, *params)]


def _is_single(param: GeometryParam, geometry: Properties) -> bool:
    """Return whether it has a single value for the whole mesh."""
    return param.domain is None and param.source is not geometry.get(UVS)


def animated_quantities(path: str, geometry: Properties, notes: Notes) -> dict[str, Quantity]:
    """Return the animated properties of a mesh by property name, with unique track names."""
    found: list[tuple[str, Quantity]] = []
    segment_names = segment_attributes(geometry)
    for param in geometry_params(geometry):
        declared_kind = param.source.metadata.get(TRACK_KIND, "")
        is_numeric = not (_is_single(param, geometry) or param.values.is_text)
        is_track = is_numeric and (declared_kind or not param.is_constant)
        if is_track and param.source.name not in segment_names:
            kind = declared_kind or ("" if param.kind is Kind.OTHER else str(param.kind))
            role = NORMALS_ROLE if param.interpretation == "normal" else ""
            found.append((param.source.name, param.quantity(param.name, kind, role)))
    user = geometry.get(USER)
    if NORMALS in geometry and not (user is not None and COMPUTED in user.properties):
        normals = GeometryParam(geometry[NORMALS])
        if not normals.is_constant:
            quantity = normals.quantity(NORMALS, "", NORMALS_ROLE, transform_normals)
            found.append((NORMALS, quantity))
    if VELOCITIES in geometry and not geometry[VELOCITIES].is_constant:
        rate, name = GeometryParam(geometry[VELOCITIES]), VELOCITIES.strip(".")
        quantity = rate.quantity(name, TrackKind.VELOCITY, "", transform_vectors)
        found.append((VELOCITIES, quantity))

    quantities: dict[str, Quantity] = {}
    names: set[str] = set()
    for key, quantity in found:
        name = quantity.name
        while name in names:
            name += "_"
        names.add(name)
        if name != quantity.name:
            notes.changed(f"{path} has {quantity.name!r} twice; the second is called {name!r}")
        quantities[key] = replace(quantity, name=name)
    return quantities


def read_attributes(
    geometry: Properties,
    mesh: PolygonMesh,
    time_s: float,
    animated: Collection[str] = (),
) -> Surface:
    """Return the attributes and face groups of a mesh at a time.

    Numeric properties become attributes, and strings per face become groups. The archive marks
    others as unfit, such as strings that change over time.

    Parameters
    ----------
    geometry : dict of Property
        Properties of the mesh.
    mesh : PolygonMesh
        The mesh, with counterclockwise faces.
    animated : collection of str, optional
        Names of properties that are read as tracks, and skipped here.
    """
    attributes: list[Attribute] = []
    groups: list[FaceGroups] = []
    segment_names = segment_attributes(geometry)
    for param in geometry_params(geometry):
        is_fixed = param.is_constant or param.source.name in segment_names
        if param.source.name in animated or _is_single(param, geometry):
            continue
        if (attribute := _attribute(param, mesh, time_s)) is not None:
            attributes.append(attribute)
        elif is_fixed and (face_groups := _groups(param, mesh, time_s)) is not None:
            groups.append(face_groups)
        else:
            param.values.archive.unfit.add(param.values)
    return Surface(attributes=tuple(attributes), groups=tuple(groups))


def segment_attributes(geometry: Properties) -> frozenset[str]:
    """Return the names of properties that change only with the faces, if meshreel wrote them."""
    user = geometry.get(USER)
    mark = user.properties.get(SEGMENT_ATTRIBUTES) if user is not None else None
    return frozenset("".join(mark.texts()[:1]).split("/")) if mark is not None else frozenset()


def read_normals(
    geometry: Properties, mesh: PolygonMesh, time_s: float
) -> npt.NDArray[np.floating] | None:
    """Return the corner normals at a time, of shape (C, 3), or None if the mesh has no normals.

    Normals whose count does not fit the mesh are read as zero. Parameters are those of
    `read_attributes`.
    """
    if NORMALS not in geometry:
        return None
    param = GeometryParam(geometry[NORMALS])
    values = param.item_values(time_s)
    domain = None if values is None else domain_of(param.domain, len(values), mesh)
    if values is not None and domain is Domain.CORNER:
        values = values[reversed_corners(mesh.counts)]
    return normals_of_corners(mesh, domain, values)


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
        if (source := properties.get(FACES)) is None:
            raise damage_error(f"the face set {name} lacks {FACES}")
        faces = np.zeros(0, np.int64)
        if source.n_samples:
            faces = source.integers(_sample_index(source, time_s))
        if len(faces) and not 0 <= faces.min() <= faces.max() < n_faces:
            raise damage_error(f"the face set {name} refers to faces outside 0..{n_faces - 1}")
        if not len(faces) and not source.is_constant:
            continue  # a material of other segments
        if (materials[faces] >= 0).any():
            numbers = np.full(n_faces, -1, np.int32)
            numbers[faces] = 0
            overlapping.append(FaceGroups(name, (name,), numbers))
        else:
            materials[faces] = len(labels)
            labels.append(name)
    return (FaceGroups("material", tuple(labels), materials), *overlapping) if labels else ()


def _attribute(param: GeometryParam, mesh: PolygonMesh, time_s: float) -> Attribute | None:
    values = None if param.width > MAX_COMPONENTS else param.numbers(time_s)
    if values is None:
        return None
    if values.dtype not in VALUE_TYPES:
        narrow_values = values.astype(np.int32)
        if (narrow_values != values).any():  # integers beyond 32 bits
            return None
        values = narrow_values
    rows = param.rows(time_s, len(values))
    domain = domain_of(param.domain, len(values if rows is None else rows), mesh)
    if domain is Domain.CORNER:
        order = reversed_corners(mesh.counts)
        values, rows = (values[order], None) if rows is None else (values, rows[order])
    return None if domain is None else Attribute(param.name, param.kind, domain, values, rows)


def domain_of(declared: Domain | None, n_values: int, mesh: PolygonMesh) -> Domain | None:
    """Return the declared domain if the number of values fits it, or else one that it fits."""
    n_items = mesh.n_items
    candidates = (*([declared] if declared else []), Domain.VERTEX, Domain.CORNER, Domain.FACE)
    return next((candidate for candidate in candidates if n_items[candidate] == n_values), None)


def _groups(param: GeometryParam, mesh: PolygonMesh, time_s: float) -> FaceGroups | None:
    if not (param.values.is_text and param.domain is Domain.FACE):
        return None
    texts = param.values.texts(_sample_index(param.values, time_s))
    indices = param.rows(time_s, len(texts))
    rows = np.arange(len(texts)) if indices is None else indices
    if len(rows) != len(mesh.counts):
        return None
    labels = dict.fromkeys(text for text in texts if text)  # faces without a group have ""
    label_numbers = {text: number for number, text in enumerate(labels)}
    numbers = np.array([label_numbers.get(text, -1) for text in texts], np.int32)[rows]
    return FaceGroups(param.name, tuple(labels), numbers)


def note_unread(objects: Sequence[AbcObject], notes: Notes) -> None:
    """Note the properties of objects that were not read, or do not fit the mesh."""
    unread: list[tuple[str, str]] = []
    for item in objects:
        try:
            for path, values in _leaves(item.properties):
                if path[-1].rpartition("samples")[1] or not BOOKKEEPING.keys().isdisjoint(path):
                    continue
                if values not in item.archive.read or values in item.archive.unfit:
                    name = next(part for part in reversed(path) if part not in (VALUES, INDICES))
                    unread.append((_subject(path, values), name.lstrip(".")))
        except FormatError as error:
            unread.append(("properties that cannot be read", f"{item.name} ({error})"))
    notes.left_out_items(sorted(unread, key=itemgetter(0)))


def _leaves(
    properties: Properties, above: tuple[str, ...] = ()
) -> Iterator[tuple[tuple[str, ...], Property]]:
    """Yield the properties with values, and the names of the compounds above and their own."""
    for name, item in properties.items():
        if item.is_compound:
            yield from _leaves(item.properties, (*above, name))
        elif not item.is_empty:
            yield (*above, name), item


def _subject(path: tuple[str, ...], values: Property) -> str:
    if USER in path:
        return "user properties"
    if values in values.archive.unfit:
        return "text that is not constant for each face" if values.is_text else MISFITS
    if PARAMS in path and GeometryParam(values).domain is None:
        return "values for a whole mesh"
    return "other properties"
