"""Attributes and groups of a part into an Alembic mesh."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.alembic.library_arrays import library_array, text_array
from meshreel.formats.alembic.names import IN_TEXTS, clean, unused_name
from meshreel.formats.alembic.winding import turned_corners
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
"""The library's names of properties of single numbers, by their type."""


def is_texture(attribute: Attribute) -> bool:
    """Whether it is texture coordinates, of two numbers."""
    return attribute.kind is Kind.UV and attribute.values.shape[1] == 2


def texture_sample(attribute: Attribute, counts: Integers, notes: list[str]) -> Any:
    """Texture coordinates as the library wants them with the first frame of a mesh."""
    return _sample("V2f", attribute, _converted(attribute, "V2f", notes), counts)


def write_attributes(
    schema: Any,
    attributes: Sequence[Attribute],
    counts: Integers,
    names: set[str],
    notes: list[str],
) -> None:
    """Write attributes of a mesh beside it.

    Parameters
    ----------
    schema : OPolyMeshSchema
    attributes : sequence of Attribute
    counts : integer array
        Corners of each face.
    names : set of str
        Names of parameters of the mesh so far; gains those of the attributes.
    notes : list of str
        Gains a sentence for names and values that the file cannot hold as they are.
    """
    geometry = ALEMBIC.load("AbcGeom")
    for attribute in attributes:
        names.add(name := unused_name(attribute.name, names))
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
    """Write materials as face sets, as programs expect them, and other groups as texts of faces.

    Parameters
    ----------
    schema : OPolyMeshSchema
    groups : sequence of FaceGroups
    names : set of str
        Names of parameters of the mesh so far; gains those of the groups.
    notes : list of str
        Gains a sentence for names that the file cannot hold as they are.
    """
    for one in groups:
        if one.name == "material":
            _write_face_sets(schema, one, notes)
        else:
            _write_texts(schema, one, names, notes)


def _write_face_sets(schema: Any, groups: FaceGroups, notes: list[str]) -> None:
    geometry, names = ALEMBIC.load("AbcGeom"), set[str]()
    for number, label in enumerate(groups.labels):
        names.add(name := unused_name(label, names))
        note_name("material", label, name, ".abc", notes)
        faces = np.flatnonzero(groups.numbers == number).astype(np.int32)
        sample = geometry.OFaceSetSchemaSample()
        sample.setFaces(library_array("Int32", faces))
        schema.createFaceSet(name).getSchema().set(sample)


def _write_texts(schema: Any, groups: FaceGroups, names: set[str], notes: list[str]) -> None:
    geometry = ALEMBIC.load("AbcGeom")
    names.add(name := unused_name(groups.name, names))
    note_name("group", groups.name, name, ".abc", notes)
    labels = [clean(label, IN_TEXTS) for label in groups.labels]
    for label, written in zip(groups.labels, labels, strict=True):
        note_name("label", label, written, ".abc", notes)
    none = len(groups.labels)  # a text behind the others, which is empty
    numbers = np.where(groups.numbers < 0, none, groups.numbers)
    sample = geometry.OStringGeomParamSample()
    sample.setVals(text_array([*labels, ""]))
    sample.setIndices(library_array("Uint32", numbers))
    sample.setScope(scope_of(Domain.FACE))
    parent = schema.getArbGeomParams()
    geometry.OStringGeomParam(parent, name, True, scope_of(Domain.FACE), 1).set(sample)


def _kind_of(attribute: Attribute) -> tuple[str, int]:
    """The library's name of a property for an attribute, and how many values make one of it."""
    width = attribute.values.shape[1]
    if is_texture(attribute):
        return "V2f", 1
    if attribute.kind is Kind.COLOR and width in (3, 4):
        return f"C{width}f", 1
    return NUMBER_KINDS[str(attribute.values.dtype)], width


def _converted(attribute: Attribute, kind: str, notes: list[str]) -> npt.NDArray[Any]:
    """Values in the type of a kind."""
    values = attribute.values
    if kind not in ("V2f", "C3f", "C4f") or values.dtype == np.float32:
        return values
    is_bytes = attribute.kind is Kind.COLOR and values.dtype == np.uint8
    found = (values / 255 if is_bytes else values).astype(np.float32)
    if is_bytes or (found != values).any():
        note = f"{attribute.kind} {attribute.name!r} is written as float32, not {values.dtype}"
        notes.extend([note] if note not in notes else [])
    return found


def _sample(kind: str, attribute: Attribute, values: npt.NDArray[Any], counts: Integers) -> Any:
    """Values, and indices if there are any, with corners in the order of the file."""
    sample = getattr(ALEMBIC.load("AbcGeom"), f"O{kind}GeomParamSample")()
    indices = attribute.indices
    if attribute.domain is Domain.CORNER:
        turned = turned_corners(counts)
        values = values[turned] if indices is None else values
        indices = None if indices is None else indices[turned]
    sample.setVals(library_array(kind, values if kind[0] in "VC" else values.ravel()))
    if indices is not None:
        sample.setIndices(library_array("Uint32", indices))
    sample.setScope(scope_of(attribute.domain))
    return sample


def scope_of(domain: Domain) -> Any:
    """What the library calls a domain."""
    return getattr(ALEMBIC.load("AbcGeom").GeometryScope, SCOPES[domain])
