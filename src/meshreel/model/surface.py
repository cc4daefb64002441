"""Surface: polygons, attributes, groups, hard edges and materials, equal in all frames."""

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError
from meshreel.model.materials import Image, Material, validated_materials

Int32s = npt.NDArray[np.int32]

VALUE_TYPES = tuple(np.dtype(name) for name in ("u1", "i4", "f4", "f8"))
"""Number types of attribute values."""

MAX_NUMBERS = 16
"""Largest number of components of an attribute value."""


class Domain(StrEnum):
    """Elements that an attribute has values for; faces are polygons, corners are theirs."""

    VERTEX = "vertex"
    FACE = "face"
    CORNER = "corner"


class Kind(StrEnum):
    """Meaning of an attribute."""

    UV = "uv"
    COLOR = "color"
    OTHER = "other"


@dataclass(frozen=True, eq=False)
class Attribute:
    """Values at every vertex, face or corner of a face.

    Parameters
    ----------
    name : str
        Name in the file, or the name of the kind ("uv", "color").
    kind : Kind
        A texture coordinate has two numbers, v upwards; a colour three or four, of 0..1 if they
        are floats, of 0..255 if they are bytes.
    domain : Domain
    values : uint8, int32, float32 or float64 array of shape (N, C)
        C in 1..16.
    indices : int32 array, optional
        Row of `values` of each vertex, face or corner. Default: one row each, in order.
    """

    name: str
    kind: Kind
    domain: Domain
    values: npt.NDArray[Any]
    indices: Int32s | None = None

    def per_item(self) -> npt.NDArray[Any]:
        """The value of each vertex, face or corner, of shape (n_items, C)."""
        return self.values if self.indices is None else self.values[self.indices]

    def __repr__(self) -> str:
        n_rows, width = self.values.shape
        return (
            f"<{self.kind} {self.name!r} of each {self.domain}: "
            f"{n_rows} x {width} {self.values.dtype}>"
        )


@dataclass(frozen=True, eq=False)
class FaceGroups:
    """Faces sorted into named groups, such as materials.

    Parameters
    ----------
    name : str
        Kind of the groups: "material", "group".
    labels : tuple of str
    numbers : int32 array of shape (P,)
        The group of each face, an index of `labels`; -1 is none.
    """

    name: str
    labels: tuple[str, ...]
    numbers: Int32s

    def __repr__(self) -> str:
        return f"<{len(self.labels)} groups {self.name!r} of {len(self.numbers)} faces>"


@dataclass(frozen=True)
class Part:
    """One of several meshes that were merged; its vertices and faces are contiguous.

    Parameters
    ----------
    name : str
        Path in the file that it came from.
    n_verts, n_faces : int
        Vertices, and faces (polygons), at least 0; the parts together are the whole mesh, in order.
    """

    name: str
    n_verts: int
    n_faces: int


@dataclass(frozen=True, eq=False)
class Surface:
    """Polygons, attributes, groups, parts and materials of a mesh, equal in all frames.

    Parameters
    ----------
    face_sizes : int32 array of shape (P,), optional
        Corners of each face, at least 3. A face of n corners is the next n - 2 triangles, a fan
        from its first corner (`meshreel.model.geometry.fans`). Default: every triangle is a face.
    attributes : tuple of Attribute
    groups : tuple of FaceGroups
    parts : tuple of Part
        Empty for a mesh of one part.
    materials : tuple of Material
        Appearance of the faces that have the material's name as label in the groups "material".
    images : tuple of Image
        Images that textures of the materials refer to.
    hard_edges : int32 array of shape (H, 2), optional
        Edges, each by its two vertices, across which faces do not share normals:
        `meshreel.corner_normals`. Each lies between two faces or more. Default: none, and the mesh
        is smooth.
    """

    face_sizes: Int32s | None = None
    attributes: tuple[Attribute, ...] = ()
    groups: tuple[FaceGroups, ...] = ()
    parts: tuple[Part, ...] = ()
    materials: tuple[Material, ...] = ()
    images: tuple[Image, ...] = ()
    hard_edges: Int32s | None = None

    def __repr__(self) -> str:
        if self.is_plain:
            return "<Surface: plain>"
        sizes = [] if self.face_sizes is None else [f"{len(self.face_sizes)} polygons"]
        parts = [f"{len(self.parts)} parts"] if self.parts else []
        looks = [f"{len(self.materials)} materials"] if self.materials else []
        groups = map(repr, self.groups)
        hard = [] if self.hard_edges is None else [f"{len(self.hard_edges)} hard edges"]
        carried = [*sizes, *hard, *map(repr, self.attributes), *groups, *parts, *looks]
        carried += map(repr, self.images)
        return f"<Surface: {', '.join(carried)}>"

    @property
    def is_plain(self) -> bool:
        """Whether the mesh has only positions and triangles."""
        carried = (self.attributes, self.groups, self.parts, self.materials, self.images)
        return self.face_sizes is None and self.hard_edges is None and not any(carried)

    def n_faces(self, n_triangles: int) -> int:
        """Number of faces (polygons), P."""
        return n_triangles if self.face_sizes is None else len(self.face_sizes)

    def n_items(self, domain: Domain, n_verts: int, n_triangles: int) -> int:
        """Number of vertices, faces or corners of faces."""
        n_faces = self.n_faces(n_triangles)
        # A face has two corners more than triangles.
        n_corners = n_triangles + 2 * n_faces
        return {Domain.VERTEX: n_verts, Domain.FACE: n_faces, Domain.CORNER: n_corners}[domain]

    def sizes(self, n_triangles: int) -> Int32s:
        """Corners of each face, of shape (P,)."""
        if self.face_sizes is None:
            return np.full(n_triangles, 3, np.int32)
        return self.face_sizes

    def validated(self, n_verts: int, n_triangles: int) -> "Surface":
        """The surface, if it fits a mesh of this many vertices and triangles.

        Its arrays are then read-only and of the documented types; sizes that are all 3 are omitted.
        Hard edges are sorted then, with the lower vertex first.

        Raises
        ------
        InvalidInputError
            Naming the part that does not fit.
        """
        sizes = _validated_sizes(self.face_sizes, n_triangles)
        n_faces = n_triangles if sizes is None else len(sizes)
        attributes = tuple(
            _validated_attribute(one, self.n_items(Domain(one.domain), n_verts, n_triangles))
            for one in self.attributes
        )
        groups = tuple(_validated_groups(one, n_faces) for one in self.groups)
        _validate_parts(self.parts, n_verts, n_faces)
        images = tuple(self.images)
        materials = validated_materials(self.materials, images)
        hard = _validated_edges(self.hard_edges, n_verts)
        return Surface(sizes, attributes, groups, tuple(self.parts), materials, images, hard)

    @property
    def size_bytes(self) -> int:
        """Size of its arrays and images."""
        arrays = [self.face_sizes, self.hard_edges, *(groups.numbers for groups in self.groups)]
        for attribute in self.attributes:
            arrays += [attribute.values, attribute.indices]
        n_shown = sum(len(image.data) for image in self.images)
        return n_shown + sum(array.nbytes for array in arrays if array is not None)

    def without_materials(self) -> "Surface":
        """The surface without materials and images; labels of faces are kept."""
        return replace(self, materials=(), images=())

    def of_kind(self, kind: Kind) -> tuple[Attribute, ...]:
        """The attributes of a kind, in order."""
        return tuple(one for one in self.attributes if one.kind is kind)


PLAIN = Surface()
"""The surface of a mesh that has only triangles."""


def _validated_sizes(sizes: Any, n_triangles: int) -> Int32s | None:
    if sizes is None:
        return None
    found = _integers(sizes, "face_sizes")
    if (found < 3).any():
        face = int(np.argmax(found < 3))
        raise InvalidInputError(f"face_sizes must be at least 3; face {face} has {found[face]}")
    total = int(found.sum(dtype=np.int64)) - 2 * len(found)
    if total != n_triangles:
        raise InvalidInputError(
            f"face_sizes make {total} triangles as fans; the mesh has {n_triangles}"
        )
    return None if (found == 3).all() else _frozen(found)


def _validated_attribute(given: Attribute, expected: int) -> Attribute:
    name, domain = f"attribute {given.name!r}", Domain(given.domain)
    values = np.asarray(given.values)
    if values.ndim != 2 or not 1 <= values.shape[1] <= MAX_NUMBERS:
        raise InvalidInputError(
            f"{name} must have values of shape (N, 1..{MAX_NUMBERS}); got {values.shape}"
        )
    if values.dtype not in VALUE_TYPES:
        allowed = ", ".join(str(one) for one in VALUE_TYPES)
        raise InvalidInputError(f"{name} must be one of {allowed}; got {values.dtype}")
    if given.indices is None:
        if len(values) != expected:
            raise InvalidInputError(f"{name} has {len(values)} values; {domain} needs {expected}")
        return replace(given, domain=domain, kind=Kind(given.kind), values=_frozen(values))
    indices = _integers(given.indices, f"indices of {name}")
    if len(indices) != expected:
        raise InvalidInputError(f"{name} has {len(indices)} indices; {domain} needs {expected}")
    if len(indices) and not 0 <= indices.min() <= indices.max() < len(values):
        raise InvalidInputError(f"{name} has indices outside of 0..{len(values) - 1}")
    return Attribute(given.name, Kind(given.kind), domain, _frozen(values), _frozen(indices))


def _validated_groups(given: FaceGroups, n_faces: int) -> FaceGroups:
    numbers = _integers(given.numbers, f"groups {given.name!r}")
    if len(numbers) != n_faces:
        raise InvalidInputError(
            f"groups {given.name!r} have {len(numbers)} numbers; there are {n_faces} faces"
        )
    if n_faces and not -1 <= numbers.min() <= numbers.max() < len(given.labels):
        raise InvalidInputError(
            f"groups {given.name!r} have numbers outside of -1..{len(given.labels) - 1}"
        )
    return FaceGroups(given.name, tuple(given.labels), _frozen(numbers))


def _validated_edges(edges: Any, n_verts: int) -> Int32s | None:
    if edges is None or not len(edges):
        return None
    found = np.asarray(edges)
    if found.ndim != 2 or found.shape[1] != 2 or not np.issubdtype(found.dtype, np.integer):
        raise InvalidInputError(
            f"hard_edges must be integers of shape (H, 2); got {found.dtype} of {found.shape}"
        )
    if not 0 <= found.min() <= found.max() < n_verts:
        raise InvalidInputError(f"hard_edges must name vertices in 0..{n_verts - 1}")
    found = np.sort(found, axis=1)
    if (found[:, 0] == found[:, 1]).any():
        vertex = found[np.argmax(found[:, 0] == found[:, 1]), 0]
        raise InvalidInputError(f"a hard edge needs two vertices; one names vertex {vertex} twice")
    keys = np.unique(found[:, 0].astype(np.int64) * n_verts + found[:, 1])
    return _frozen(np.stack([keys // n_verts, keys % n_verts], axis=1).astype(np.int32))


def _validate_parts(parts: tuple[Part, ...], n_verts: int, n_faces: int) -> None:
    if not parts:
        return
    if any(part.n_verts < 0 or part.n_faces < 0 for part in parts):
        raise InvalidInputError("a part has a negative number of vertices or faces")
    total = sum(part.n_verts for part in parts), sum(part.n_faces for part in parts)
    if total != (n_verts, n_faces):
        raise InvalidInputError(
            f"parts have {total[0]} vertices and {total[1]} faces; "
            f"the mesh has {n_verts} and {n_faces}"
        )


def _integers(values: Any, name: str) -> Int32s:
    array = np.asarray(values)
    if array.ndim != 1 or not np.issubdtype(array.dtype, np.integer):
        raise InvalidInputError(
            f"{name} must be integers of shape (N,); got {array.dtype} of {array.shape}"
        )
    return np.ascontiguousarray(array, dtype=np.int32)


def _frozen(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    view = array.view()
    view.flags.writeable = False
    return view
