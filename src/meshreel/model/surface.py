"""Surface: polygons, attributes, groups, hard edges and materials, equal in all frames."""

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import rows_as_bytes
from meshreel.errors import InvalidInputError
from meshreel.kernel.polygons import triangle_corners
from meshreel.model.cells import Cells, validated_cells
from meshreel.model.materials import Image, Material, validated_materials
from meshreel.model.validation import frozen, restore

Int32s = npt.NDArray[np.int32]

VALUE_TYPES = tuple(np.dtype(name) for name in ("u1", "i4", "f4", "f8"))
"""Number types of attribute values."""

MAX_COMPONENTS = 16
"""Largest number of components of an attribute value."""


class Domain(StrEnum):
    """Elements that an attribute has values for; faces are polygons, with their corners.

    Only meshes of cells have cells.
    """

    VERTEX = "vertex"
    FACE = "face"
    CORNER = "corner"
    CELL = "cell"


SURFACE_DOMAINS = (Domain.VERTEX, Domain.FACE, Domain.CORNER)
"""Domains of a mesh without cells."""


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
        A texture coordinate has two numbers, v pointing up; a color three or four: red, green, blue
        in sRGB (IEC 61966-2-1), and opacity. Floats are in 0..1 or beyond, integers in 0..255.
    domain : Domain
    values : uint8, int32, float32 or float64 array of shape (N, C)
        C in 1..16.
    indices : int32 array, optional
        Row of `values` for each vertex, face or corner. Default: one row each, in order.
    """

    name: str
    kind: Kind
    domain: Domain
    values: npt.NDArray[Any]
    indices: Int32s | None = None
    __setstate__ = restore

    def per_item(self) -> npt.NDArray[Any]:
        """The value of each vertex, face or corner, of shape (n_items, C)."""
        return self.values if self.indices is None else self.values[self.indices]

    def indexed(self, values: npt.NDArray[Any]) -> "Attribute":
        """Return the attribute with these values of its items; each distinct row is stored once."""
        _, rows, numbers = np.unique(rows_as_bytes(values), return_index=True, return_inverse=True)
        return replace(self, values=values[rows], indices=numbers.astype(np.int32))

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
        The group of each face, an index into `labels`; -1 means none.
    """

    name: str
    labels: tuple[str, ...]
    numbers: Int32s
    __setstate__ = restore

    def __repr__(self) -> str:
        return f"<{len(self.labels)} groups {self.name!r} of {len(self.numbers)} faces>"


@dataclass(frozen=True)
class Part:
    """One of several merged meshes; its vertices and faces are contiguous.

    Parameters
    ----------
    name : str
        Its path in the original file.
    n_verts, n_faces : int
        Vertices and faces (polygons), at least 0; all parts in order make up the mesh.
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
        Number of corners of each face, at least 3. A face with n corners consists of the next
        n - 2 triangles, for example a fan; each must share an edge with an earlier one, as
        `docs/format.md` (POLYGONS) describes. Default: every triangle is a face.
    attributes : tuple of Attribute
    groups : tuple of FaceGroups
    parts : tuple of Part
        Empty for a mesh of one part.
    materials : tuple of Material
        Appearance of the faces whose label in the groups "material" is the material's name.
    images : tuple of Image
        Images of the textures.
    hard_edges : int32 array of shape (H, 2), optional
        Vertex pairs of edges across which faces do not share normals (`meshreel.corner_normals`).
        Each edge has two or more faces. Default: none, and the mesh is smooth.
    is_ordered : bool, default True
        Whether the order of vertices and faces matters. Formats such as Draco change it in every
        frame, so it does not matter; `meshreel.encode` then drops it by default.
    cells : Cells, optional
        Volume cells. The faces must be their surface, as `Cells.surface` returns it. Default: none.
    displaced_by : tuple of str and float, optional
        Track that moved the vertices, multiplied by a factor, as `displace` of `meshreel.load` sets
        it. Streams do not store it. Default: none.
    """

    face_sizes: Int32s | None = None
    attributes: tuple[Attribute, ...] = ()
    groups: tuple[FaceGroups, ...] = ()
    parts: tuple[Part, ...] = ()
    materials: tuple[Material, ...] = ()
    images: tuple[Image, ...] = ()
    hard_edges: Int32s | None = None
    is_ordered: bool = True
    cells: Cells | None = None
    displaced_by: tuple[str, float] | None = None
    __setstate__ = restore

    def __repr__(self) -> str:
        if self.is_plain:
            return "<Surface: plain>"
        sizes = [] if self.face_sizes is None else [f"{len(self.face_sizes)} polygons"]
        parts = [f"{len(self.parts)} parts"] if self.parts else []
        materials = [f"{len(self.materials)} materials"] if self.materials else []
        hard = [] if self.hard_edges is None else [f"{len(self.hard_edges)} hard edges"]
        cells = [] if self.cells is None else [f"{self.cells.n_cells} cells"]
        contents = [*cells, *sizes, *hard, *map(repr, (*self.attributes, *self.groups))]
        contents += [*parts, *materials, *map(repr, self.images)]
        return f"<Surface: {', '.join(contents)}>"

    @property
    def is_plain(self) -> bool:
        """Whether the mesh has only positions and triangles."""
        contents = (self.attributes, self.groups, self.parts, self.materials, self.images)
        arrays = (self.face_sizes, self.hard_edges, self.cells)
        return all(array is None for array in arrays) and not any(contents)

    def n_faces(self, n_triangles: int) -> int:
        """Number of faces (polygons), P."""
        return n_triangles if self.face_sizes is None else len(self.face_sizes)

    def n_items(self, domain: Domain, n_verts: int, n_triangles: int) -> int:
        """Number of vertices, faces, corners of faces, or cells."""
        n_faces = self.n_faces(n_triangles)
        # A face has two more corners than triangles.
        n_corners = n_triangles + 2 * n_faces
        n_cells = 0 if self.cells is None else self.cells.n_cells
        return {
            Domain.VERTEX: n_verts,
            Domain.FACE: n_faces,
            Domain.CORNER: n_corners,
            Domain.CELL: n_cells,
        }[domain]

    def sizes(self, n_triangles: int) -> Int32s:
        """Corners of each face, of shape (P,)."""
        if self.face_sizes is None:
            return np.full(n_triangles, 3, np.int32)
        return self.face_sizes

    def validated(self, n_verts: int, faces: npt.NDArray[np.integer]) -> "Surface":
        """Return the surface if it fits a mesh with these vertices and triangles.

        The arrays of the result are read-only and of the documented types; face sizes are None if
        all are 3; hard edges are sorted, lower vertex first.

        Raises
        ------
        InvalidInputError
            If a field does not fit; the message names it.
        """
        n_triangles = len(faces)
        sizes = _validated_sizes(self.face_sizes, faces)
        n_faces = n_triangles if sizes is None else len(sizes)
        cells = self.cells if self.cells is None else validated_cells(self.cells, n_verts)
        if cells is not None:
            expected = cells.surface(n_verts)
            actual = np.full(n_triangles, 3) if sizes is None else sizes
            has_sizes = np.array_equal(actual, expected.sizes)
            if not (has_sizes and np.array_equal(faces, expected.triangles)):
                raise InvalidInputError(
                    "the faces are not the surface of the cells; let meshreel derive them: "
                    "MeshSequence(vertices, cells=cells)"
                )
        attributes = tuple(
            _validated_attribute(
                attribute, self.n_items(Domain(attribute.domain), n_verts, n_triangles)
            )
            for attribute in self.attributes
        )
        groups = tuple(_validated_groups(group, n_faces) for group in self.groups)
        if any(part.n_verts < 0 or part.n_faces < 0 for part in self.parts):
            raise InvalidInputError("a part has a negative number of vertices or faces")
        totals = [
            sum(part.n_verts for part in self.parts),
            sum(part.n_faces for part in self.parts),
        ]
        if self.parts and totals != [n_verts, n_faces]:
            raise InvalidInputError(
                f"parts have {totals[0]} vertices and {totals[1]} faces; "
                f"the mesh has {n_verts} and {n_faces}"
            )
        images = tuple(self.images)
        materials = validated_materials(self.materials, images)
        hard = _validated_edges(self.hard_edges, n_verts)
        return replace(
            self,
            face_sizes=sizes,
            attributes=attributes,
            groups=groups,
            parts=tuple(self.parts),
            materials=materials,
            images=images,
            hard_edges=hard,
            cells=cells,
        )

    @property
    def image_bytes(self) -> int:
        """Size of its images."""
        return sum(len(image.data) for image in self.images)

    @property
    def size_bytes(self) -> int:
        """Size of its arrays."""
        arrays = [self.face_sizes, self.hard_edges, *(groups.numbers for groups in self.groups)]
        for attribute in self.attributes:
            arrays += [attribute.values, attribute.indices]
        cell_bytes = 0 if self.cells is None else self.cells.size_bytes
        return cell_bytes + sum(array.nbytes for array in arrays if array is not None)

    def without_materials(self) -> "Surface":
        """The surface without materials and images, but with the labels of faces."""
        return replace(self, materials=(), images=())

    def of_kind(self, kind: Kind) -> tuple[Attribute, ...]:
        """The attributes of a kind, in order."""
        return tuple(attribute for attribute in self.attributes if attribute.kind is kind)


PLAIN = Surface()
"""The surface of a mesh that consists of triangles only."""


def _validated_sizes(sizes: Any, faces: npt.NDArray[np.integer]) -> Int32s | None:
    if sizes is None:
        return None
    array = _integers(sizes, "face_sizes")
    if (array < 3).any():
        face = int(np.argmax(array < 3))
        raise InvalidInputError(f"face_sizes must be at least 3; face {face} has {array[face]}")
    total = int(array.sum(dtype=np.int64)) - 2 * len(array)
    if total != len(faces):
        raise InvalidInputError(f"face_sizes imply {total} triangles; the mesh has {len(faces)}")
    if (array == 3).all():
        return None
    triangle_corners(array, faces)  # raises if triangles of a polygon do not adjoin
    return frozen(array)


def _validated_attribute(attribute: Attribute, n_items: int) -> Attribute:
    name, domain = f"attribute {attribute.name!r}", Domain(attribute.domain)
    values = np.asarray(attribute.values)
    if values.ndim != 2 or not 1 <= values.shape[1] <= MAX_COMPONENTS:
        raise InvalidInputError(
            f"{name} must have values of shape (N, 1..{MAX_COMPONENTS}); got {values.shape}"
        )
    if values.dtype not in VALUE_TYPES:
        allowed = ", ".join(map(str, VALUE_TYPES))
        raise InvalidInputError(f"{name} must be one of {allowed}; got {values.dtype}")
    kind = Kind(attribute.kind)
    if attribute.indices is None:
        if len(values) != n_items:
            raise InvalidInputError(f"{name} has {len(values)} values; {domain} needs {n_items}")
        return replace(attribute, domain=domain, kind=kind, values=frozen(values))
    indices = _integers(attribute.indices, f"indices of {name}")
    if len(indices) != n_items:
        raise InvalidInputError(f"{name} has {len(indices)} indices; {domain} needs {n_items}")
    if len(indices) and not 0 <= indices.min() <= indices.max() < len(values):
        raise InvalidInputError(f"{name} has indices outside 0..{len(values) - 1}")
    return Attribute(attribute.name, kind, domain, frozen(values), frozen(indices))


def _validated_groups(groups: FaceGroups, n_faces: int) -> FaceGroups:
    numbers = _integers(groups.numbers, f"groups {groups.name!r}")
    if len(numbers) != n_faces:
        raise InvalidInputError(
            f"groups {groups.name!r} have {len(numbers)} numbers; there are {n_faces} faces"
        )
    if n_faces and not -1 <= numbers.min() <= numbers.max() < len(groups.labels):
        raise InvalidInputError(
            f"groups {groups.name!r} have numbers outside -1..{len(groups.labels) - 1}"
        )
    return FaceGroups(groups.name, tuple(groups.labels), frozen(numbers))


def _validated_edges(edges: Any, n_verts: int) -> Int32s | None:
    if edges is None or not len(edges):
        return None
    array = np.asarray(edges)
    if array.ndim != 2 or array.shape[1] != 2 or not np.issubdtype(array.dtype, np.integer):
        raise InvalidInputError(
            f"hard_edges must be integers of shape (H, 2); got {array.dtype} of {array.shape}"
        )
    if not 0 <= array.min() <= array.max() < n_verts:
        raise InvalidInputError(f"hard_edges must be vertex indices in 0..{n_verts - 1}")
    low, high = np.sort(array, axis=1).T
    if (low == high).any():
        vertex = low[np.argmax(low == high)]
        raise InvalidInputError(f"a hard edge needs two vertices; one has vertex {vertex} twice")
    keys = np.unique(low.astype(np.int64) * n_verts + high)
    return frozen(np.stack([keys // n_verts, keys % n_verts], axis=1).astype(np.int32))


def _integers(values: Any, name: str) -> Int32s:
    array = np.asarray(values)
    if array.ndim != 1 or not np.issubdtype(array.dtype, np.integer):
        raise InvalidInputError(
            f"{name} must be integers of shape (N,); got {array.dtype} of {array.shape}"
        )
    return np.ascontiguousarray(array, dtype=np.int32)


def surface_of_cells(cells: Cells, n_verts: int) -> tuple[Int32s, Surface]:
    """Return the faces of cells, of shape (M, 3), and a surface with their polygons and cells.

    Raises
    ------
    InvalidInputError
        As `validated_cells`, or if the cells have no surface.
    """
    cells = validated_cells(cells, n_verts)
    polygons = cells.surface(n_verts)
    sizes = None if (polygons.sizes == 3).all() else polygons.sizes
    return polygons.triangles, Surface(face_sizes=sizes, cells=cells)
