"""Writing the attributes and face groups of a part to an Alembic mesh."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.alembic.attributes import SEGMENT_ATTRIBUTES
from meshreel.formats.alembic.library_arrays import library_array, text_array
from meshreel.formats.alembic.names import IN_TEXTS, clean, clean_unique_name
from meshreel.formats.alembic.winding import reversed_corners
from meshreel.formats.notes import note_name
from meshreel.model.geometry.polygons import Integers
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind
from meshreel.runtime.extras import ALEMBIC

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
            kind, _ = _kind_of(attribute)
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
        kind, extent = _kind_of(attribute)
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


def _kind_of(attribute: Attribute) -> tuple[str, int]:
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
