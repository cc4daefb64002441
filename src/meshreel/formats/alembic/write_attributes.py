"""Writing the attributes and face groups of a part to an Alembic mesh."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.alembic.library_arrays import library_array, text_array
from meshreel.formats.alembic.names import IN_TEXTS, clean, clean_unique_name
from meshreel.formats.alembic.winding import reversed_corners
from meshreel.formats.extras import ALEMBIC
from meshreel.formats.notes import note_name
from meshreel.model.geometry.ragged import Integers
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind

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
    """Return texture coordinates as the UV sample of the first frame of a mesh."""
    return _sample("V2f", attribute, _converted(attribute, "V2f", notes), counts)


def write_attributes(
    schema: Any,
    attributes: Sequence[Attribute],
    counts: Integers,
    names: set[str],
    notes: list[str],
) -> None:
    """Write the attributes of a mesh as geometry parameters.

    Parameters
    ----------
    schema : OPolyMeshSchema
    attributes : sequence of Attribute
    counts : integer array
        Corners of each face.
    names : set of str
        Names of the parameters so far; gains those of the attributes.
    notes : list of str
        Gains a sentence for names and values that the file cannot store exactly.
    """
    geometry = ALEMBIC.load("AbcGeom")
    for attribute in attributes:
        names.add(name := clean_unique_name(attribute.name, names))
        note_name("attribute", attribute.name, name, ".abc", notes)
        kind, extent = _kind_of(attribute)
        values = _converted(attribute, kind, notes)
        param = getattr(geometry, f"O{kind}GeomParam")(
            schema.getArbGeomParams(), name, attribute.indices is not None,
            scope_of(attribute.domain), extent,
        )  # fmt: skip
        param.set(_sample(kind, attribute, values, counts))


def write_groups(
    schema: Any, groups: Sequence[FaceGroups], names: set[str], notes: list[str]
) -> None:
    """Write materials as face sets, and other groups as a text per face.

    Parameters
    ----------
    schema : OPolyMeshSchema
    groups : sequence of FaceGroups
    names : set of str
        Names of the parameters so far; gains those of the groups.
    notes : list of str
        Gains a sentence for names that the file cannot store exactly.
    """
    for one in groups:
        if one.name == "material":
            _write_face_sets(schema, one, notes)
        else:
            _write_texts(schema, one, names, notes)


def _write_face_sets(schema: Any, groups: FaceGroups, notes: list[str]) -> None:
    geometry, names = ALEMBIC.load("AbcGeom"), set[str]()
    for number, label in enumerate(groups.labels):
        names.add(name := clean_unique_name(label, names))
        note_name("material", label, name, ".abc", notes)
        faces = np.flatnonzero(groups.numbers == number).astype(np.int32)
        sample = geometry.OFaceSetSchemaSample()
        sample.setFaces(library_array("Int32", faces))
        schema.createFaceSet(name).getSchema().set(sample)


def _write_texts(schema: Any, groups: FaceGroups, names: set[str], notes: list[str]) -> None:
    geometry = ALEMBIC.load("AbcGeom")
    names.add(name := clean_unique_name(groups.name, names))
    note_name("group", groups.name, name, ".abc", notes)
    labels = [clean(label, IN_TEXTS) for label in groups.labels]
    for label, written in zip(groups.labels, labels, strict=True):
        note_name("label", label, written, ".abc", notes)
    none = len(groups.labels)  # the index of the empty text at the end
    numbers = np.where(groups.numbers < 0, none, groups.numbers)
    sample = geometry.OStringGeomParamSample()
    sample.setVals(text_array([*labels, ""]))
    sample.setIndices(library_array("Uint32", numbers))
    sample.setScope(scope_of(Domain.FACE))
    parent = schema.getArbGeomParams()
    geometry.OStringGeomParam(parent, name, True, scope_of(Domain.FACE), 1).set(sample)


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
