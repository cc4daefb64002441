"""Texture coordinates, colours, other attributes and groups of an Alembic mesh."""

from collections.abc import Collection, Mapping

import numpy as np
import numpy.typing as npt

from meshreel.formats.alembic.archive import Property
from meshreel.formats.alembic.ogawa import damaged
from meshreel.formats.alembic.params import GeometryParam
from meshreel.formats.alembic.time_sampling import between
from meshreel.formats.alembic.winding import turned_corners
from meshreel.formats.notes import UNCHANGING, note_kinds, note_moving
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.surface import MAX_NUMBERS, Attribute, Domain, FaceGroups, Surface

NORMALS, VELOCITIES = "N", ".velocities"
"""Names of properties of a mesh."""

COMPUTED = "meshreel:computed"
"""User property of a mesh whose normals we compute from faces and hard edges: they are no track."""

NO_GROUP = ""
"""Label of faces that are in no group."""

Properties = Mapping[str, Property]


def read_attributes(
    geometry: Properties,
    mesh: PolygonMesh,
    time_s: float,
    notes: list[str],
    moving: Collection[str] = (),
) -> Surface:
    """The surface of a mesh at a time; notes gain a sentence on what is left out of it.

    Numbers become attributes, and texts of faces become groups. Texts that change over time cannot
    be carried.

    Parameters
    ----------
    geometry : dict of Property
        Those of the mesh.
    mesh : PolygonMesh
        Its faces, in meshreel's order.
    time_s : float
    notes : list of str
    moving : collection of str, optional
        Names of the properties that are passed over, for they are tracks.
    """
    own = [geometry["uv"]] if "uv" in geometry else []
    other = geometry[".arbGeomParams"].properties if ".arbGeomParams" in geometry else {}
    attributes: list[Attribute] = []
    groups: list[FaceGroups] = []
    changing, whole, unfit = (list[str]() for _ in range(3))
    for found in [*own, *other.values()]:
        param = GeometryParam(found, time_s)
        if found.header.name in moving:
            continue
        if param.domain is None and found not in own:
            whole.append(param.name)
        elif (attribute := _attribute(param, mesh)) is not None:
            attributes.append(attribute)
        elif (sorted_faces := _groups(param, mesh)) is not None:
            groups.append(sorted_faces)
        else:
            (unfit if param.is_constant else changing).append(param.name)
    note_moving(notes, changing)
    if VELOCITIES in geometry and VELOCITIES not in moving:
        note_kinds(notes, UNCHANGING, ["velocities"])
    note_kinds(notes, "values for a whole mesh", whole)
    note_kinds(notes, "what is neither numbers nor a text for each face", unfit)
    return Surface(attributes=tuple(attributes), groups=tuple(groups))


def read_normals(
    geometry: Properties, mesh: PolygonMesh, time_s: float
) -> npt.NDArray[np.floating] | None:
    """Normals at a time, of shape (C, 3); 0 where they do not fit the mesh, None without any.

    Parameters
    ----------
    geometry, mesh, time_s
        As of `read_attributes`.
    """
    if NORMALS not in geometry:
        return None
    param = GeometryParam(geometry[NORMALS], time_s)
    values = param.every_number()
    if values is None or values.shape[1] != 3 or values.dtype.kind != "f":
        return np.zeros((len(mesh.corners), 3))
    domain = domain_of(param.domain, len(values), mesh)
    if domain is Domain.CORNER:
        return values[turned_corners(mesh.counts)]
    if domain is Domain.FACE:
        return np.repeat(values, mesh.counts, axis=0)
    return np.zeros((len(mesh.corners), 3)) if domain is None else values[mesh.corners]


def read_face_sets(
    face_sets: Mapping[str, Properties], n_faces: int, time_s: float
) -> tuple[FaceGroups, ...]:
    """Face sets as materials, which is what they are mostly used for.

    One that has faces of another before it is a group of its own, with its own name.

    Raises
    ------
    FormatError
        If one names a face that is not there.
    """
    materials = np.full(n_faces, -1, np.int32)
    labels: list[str] = []
    own = []
    for name, properties in face_sets.items():
        faces = _faces_of(properties, name, n_faces, time_s)
        if (materials[faces] >= 0).any():
            numbers = np.full(n_faces, -1, np.int32)
            numbers[faces] = 0
            own.append(FaceGroups(name, (name,), numbers))
        else:
            materials[faces] = len(labels)
            labels.append(name)
    return (FaceGroups("material", tuple(labels), materials), *own) if labels else ()


def _attribute(param: GeometryParam, mesh: PolygonMesh) -> Attribute | None:
    if param.width > MAX_NUMBERS:
        return None
    if (values := param.numbers()) is None:
        return None
    indices = param.indices(len(values))
    domain = domain_of(param.domain, len(values) if indices is None else len(indices), mesh)
    if domain is Domain.CORNER:
        turned = turned_corners(mesh.counts)
        values, indices = (values[turned], None) if indices is None else (values, indices[turned])
    return None if domain is None else Attribute(param.name, param.kind, domain, values, indices)


def domain_of(said: Domain | None, n_values: int, mesh: PolygonMesh) -> Domain | None:
    """The domain that the file says, or another one that has as many items."""
    n_items = {
        Domain.VERTEX: len(mesh.vertices),
        Domain.CORNER: len(mesh.corners),
        Domain.FACE: len(mesh.counts),
    }
    first = [said] if said else []
    return next((one for one in [*first, *n_items] if n_items[one] == n_values), None)


def _groups(param: GeometryParam, mesh: PolygonMesh) -> FaceGroups | None:
    if not (param.is_text and param.is_constant and param.domain is Domain.FACE):
        return None
    texts = param.texts()
    indices = param.indices(len(texts))
    rows = np.arange(len(texts)) if indices is None else indices
    if len(rows) != len(mesh.counts):
        return None
    named = [text for text in dict.fromkeys(texts) if text != NO_GROUP]
    labels = {text: number for number, text in enumerate(named)}
    numbers = [labels.get(text, -1) for text in texts]
    return FaceGroups(param.name, tuple(labels), np.array(numbers, np.int32)[rows])


def _faces_of(
    properties: Properties, name: str, n_faces: int, time_s: float
) -> npt.NDArray[np.int64]:
    if (found := properties.get(".faces")) is None:
        raise damaged(f"the face set {name} has no faces")
    if found.header.n_samples == 0:
        return np.zeros(0, np.int64)
    faces = found.whole_numbers(between(found.times_s, time_s)[0])
    if len(faces) and not 0 <= faces.min() <= faces.max() < n_faces:
        raise damaged(f"the face set {name} names faces outside of 0..{n_faces - 1}")
    return faces
