"""Surface extraction from VTK cells: keep 2D cells, take the boundary of 3D cells."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any
from weakref import WeakValueDictionary

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.errors import FormatError, InvalidInputError, Keyword
from meshreel.formats.surfaces.polygons import PolygonMesh, polygon_mesh
from meshreel.kernel.cells import cell_sizes
from meshreel.model.cells import Cells as VolumeCells
from meshreel.model.cells import validated_cells
from meshreel.model.geometry.polygons import join_triangles, ragged_indices
from meshreel.model.notes import NoteKind, Notes, listed
from meshreel.model.sequence import Faces, Vertices, mesh_digest
from meshreel.model.surface import Domain, Surface
from meshreel.runtime.counting import counted

POLY_VERTEX, POLY_LINE, STRIP, POLYGON = 2, 4, 6, 7
QUADRATIC_POLYGON = 36
POINTS_AND_LINES = (0, 1, 2, 3, 4, 21, 35, 68, 75)

_TETRA = ((0, 1, 3), (1, 2, 3), (2, 0, 3), (0, 2, 1))
_HEXAHEDRON = (
    (0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (3, 7, 6, 2), (0, 3, 2, 1), (4, 5, 6, 7),
)  # fmt: skip
_VOXEL = (
    (0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6),
)  # fmt: skip
_WEDGE = ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5))
_PYRAMID = ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4))
_PENTAGONAL_PRISM = (
    (0, 4, 3, 2, 1), (5, 6, 7, 8, 9),
    (0, 1, 6, 5), (1, 2, 7, 6), (2, 3, 8, 7), (3, 4, 9, 8), (4, 0, 5, 9),
)  # fmt: skip
_HEXAGONAL_PRISM = (
    (0, 5, 4, 3, 2, 1), (6, 7, 8, 9, 10, 11),
    (0, 1, 7, 6), (1, 2, 8, 7), (2, 3, 9, 8), (3, 4, 10, 9), (4, 5, 11, 10), (5, 0, 6, 11),
)  # fmt: skip
_SHAPES: dict[tuple[int, ...], Sequence[tuple[int, ...]]] = {
    (5, 22, 34, 69, 76): ((0, 1, 2),),
    (8,): ((0, 1, 3, 2),),
    (9, 23, 28, 30, 70, 77): ((0, 1, 2, 3),),
    (10, 24, 71, 78): _TETRA,
    (11,): _VOXEL,
    (12, 25, 29, 33, 72, 79): _HEXAHEDRON,
    (13, 26, 31, 32, 73, 80): _WEDGE,
    (14, 27, 37, 74, 81): _PYRAMID,
    (15,): _PENTAGONAL_PRISM,
    (16,): _HEXAGONAL_PRISM,
}
CELL_FACES = {kind: faces for kinds, faces in _SHAPES.items() for kind in kinds}
"""Faces of cells by VTK type, those of solids counterclockwise as seen from outside.

Points in the middle of edges, faces and cells are ignored.
"""

MAX_FACE_CORNERS = 256
POLYHEDRON = -1
"""Type of polyhedra, whose points are as in VTK's legacy files.

They are the number of faces, then for each face its number of corners and their point indices.
"""
SOLIDS = [POLYHEDRON, *(kind for kind, faces in CELL_FACES.items() if len(faces) > 1)]
VTK_POLYHEDRON = 42
"""VTK's type of polyhedra, whose faces are in separate arrays of `.vtu` and VTKHDF files."""


@dataclass(frozen=True, eq=False)
class Cells:
    """VTK cells of any type."""

    types: npt.NDArray[Any]
    """Integer array of shape (N,). VTK cell types, or `POLYHEDRON`."""
    counts: npt.NDArray[np.int64]
    """int64 array of shape (N,). Number of points of each cell."""
    points: npt.NDArray[np.int64]
    """int64 array of shape (sum of counts,). Point indices of all cells, concatenated."""

    @classmethod
    def join(cls, groups: Iterable["Cells"]) -> "Cells":
        """Return the cells of all groups."""
        none = np.empty(0, np.int64)
        rows = [(cells.types, cells.counts, cells.points) for cells in groups]
        columns = zip(*(rows or [(none, none, none)]), strict=True)
        return cls(*map(np.concatenate, columns))

    @classmethod
    def polyhedra(cls, n_faces: Integers, sizes: Integers, nodes: Integers) -> "Cells":
        """Return polyhedra.

        Parameters
        ----------
        n_faces : integer array of shape (N,)
            Number of faces of each.
        sizes : integer array of shape (sum of n_faces,)
            Number of corners of each face.
        nodes : integer array of shape (sum of sizes,)
            Point indices of the corners.
        """
        face_records = np.empty(len(nodes) + len(sizes), np.int64)
        starts = np.cumsum(sizes + 1) - sizes - 1
        face_records[starts] = sizes
        face_records[ragged_indices(starts + 1, sizes)] = nodes
        first = np.cumsum(n_faces) - n_faces  # the first face of each cell
        bounds = np.append(starts, len(face_records))
        lengths = bounds[first + n_faces] - bounds[first] + 1
        points = np.insert(face_records, bounds[first], n_faces)
        return cls(np.full(len(n_faces), POLYHEDRON), lengths, points)

    def with_polyhedra(self, polyhedra: "Cells") -> "Cells":
        """Return the cells with polyhedra in place of those of type `VTK_POLYHEDRON`."""
        is_polyhedron = self.types == VTK_POLYHEDRON
        counts, starts = self.counts.copy(), np.cumsum(self.counts) - self.counts
        counts[is_polyhedron] = polyhedra.counts
        starts[is_polyhedron] = len(self.points) + np.cumsum(polyhedra.counts) - polyhedra.counts
        points = np.concatenate([self.points, polyhedra.points])[ragged_indices(starts, counts)]
        types = np.where(is_polyhedron, POLYHEDRON, self.types.astype(np.int64))
        return Cells(types, counts, points)

    def with_faces(
        self, n_faces: Integers, faces: Integers, sizes: Integers, nodes: Integers
    ) -> "Cells":
        """Return the cells with their polyhedra, whose faces are in separate arrays.

        Parameters
        ----------
        n_faces : integer array of shape (N,)
            Number of faces of each cell; 0 if it is no polyhedron.
        faces : integer array of shape (sum of n_faces,)
            Indices of its faces.
        sizes, nodes : integer arrays
            Number of corners of each face, and their point indices, concatenated.

        Raises
        ------
        FormatError
            If a face does not exist or has too many corners, or the arrays do not fit each other.
        """
        is_polyhedron = self.types == VTK_POLYHEDRON
        if len(n_faces) != len(self.types) or n_faces[~is_polyhedron].any():
            raise FormatError(f"faces of {len(n_faces)} cells do not fit its polyhedra")
        if ((faces < 0) | (faces >= len(sizes))).any():
            raise FormatError(f"a polyhedron has a face outside 0..{len(sizes) - 1}")
        _validate_face_sizes(sizes)
        corners = nodes[ragged_indices((np.cumsum(sizes) - sizes)[faces], sizes[faces])]
        return self.with_polyhedra(Cells.polyhedra(n_faces[is_polyhedron], sizes[faces], corners))

    def shifted(self, offset: int, n_points: int) -> "Cells":
        """Return cells whose point indices are larger by `offset`.

        Raises
        ------
        FormatError
            If one of them is not one of `n_points` points, or a polyhedron is damaged.
        """
        is_index = np.ones(len(self.points), bool)
        rows = np.flatnonzero(self.types == POLYHEDRON)
        if len(rows):
            first = (np.cumsum(self.counts) - self.counts)[rows]
            is_index[first] = False
            is_index[_face_starts(self.points, first, self.counts[rows], rows)[0]] = False
        if not ((self.points >= 0) & (self.points < n_points) | ~is_index).all():
            raise FormatError(f"a cell has a point index outside 0..{n_points - 1}")
        return replace(self, points=self.points + offset * is_index)


@dataclass(frozen=True, eq=False)
class CellSurface:
    """The polygons of a set of cells, and the cells and points that they come from."""

    counts: npt.NDArray[np.int64]
    corners: npt.NDArray[np.int32]
    """Integer arrays. Polygons as in `PolygonMesh`; corners index the kept vertices."""
    cells: npt.NDArray[np.int64]
    """int64 array of shape (P,). The source cell of each polygon."""
    points: npt.NDArray[np.int64] | slice
    """int64 array or slice. Points that become vertices, in order: all, or the boundary points of
    solid cells.
    """
    n_solids: int = 0
    n_lost: int = 0
    """Numbers of solid cells, and of points that do not become vertices."""
    volume: VolumeCells | None = None
    """Model.Cells. The cells, if they are kept; then all their points are vertices."""
    volume_rows: npt.NDArray[np.int64] | None = None
    """int64 array. Rows of the cell data that belong to these cells. Default: all."""
    changes: tuple[str, ...] = ()
    """Conversions of cell types, for notes."""
    unstored: tuple[str, ...] = ()
    """Types of cells that cannot be stored, if solids are reduced to their surface, for notes."""

    has_points_or_lines: bool = False
    has_middle_nodes: bool = False
    """Whether cells without faces are ignored, and nodes in the middle of edges or flat cells."""

    def note_interior(self, notes: Notes) -> None:
        """Note converted cell types, and what is not kept, such as the inside of solids."""
        if self.has_points_or_lines:
            notes.left_out("cells that are points and lines")
        if self.has_middle_nodes:
            text = "flat cells with nodes in the middle of edges are read as their corners"
            notes.changed("types of cells", text)
        for change in self.changes:
            notes.changed("types of cells", change)
        if self.n_solids:
            text = f"left out: the inside of {counted(self.n_solids, 'solid cell')}"
            if self.n_lost:
                text += f", with {counted(self.n_lost, 'node')} that no face has"
            if self.unstored:
                text += f"; cells of {listed(self.unstored)} cannot be stored"
            notes.add(NoteKind.LEFT_OUT, "the inside of solid cells", text)

    @property
    def source_rows(self) -> Mapping[Domain, npt.NDArray[np.int64] | slice]:
        """Rows of the point data and cell data that belong to the vertices and faces, or cells."""
        if self.volume is not None:
            rows = slice(None) if self.volume_rows is None else self.volume_rows
            return {Domain.VERTEX: self.points, Domain.CELL: rows}
        return {Domain.VERTEX: self.points, Domain.FACE: self.cells}

    @property
    def cell_domain(self) -> Domain:
        """The domain of cell data: cells if they are kept, else faces."""
        return Domain.FACE if self.volume is None else Domain.CELL

    @property
    def n_cell_items(self) -> int:
        """Number of cells if they are kept, else of faces."""
        return len(self.cells) if self.volume is None else self.volume.n_cells

    def n_verts(self, n_points: int) -> int:
        """Number of vertices of the surface, given the number of points."""
        return n_points if isinstance(self.points, slice) else len(self.points)

    @property
    def size_bytes(self) -> int:
        """Size of its arrays."""
        arrays = [array.nbytes for array in vars(self).values() if isinstance(array, np.ndarray)]
        return sum(arrays) + (0 if self.volume is None else self.volume.size_bytes)

    def without_points(self, is_lost: npt.NDArray[np.bool_]) -> "CellSurface":
        """Return the surface without points that none of its cells has."""
        if not isinstance(self.points, slice):  # only the points of faces
            return self
        kept, numbers = np.flatnonzero(~is_lost), np.cumsum(~is_lost) - 1
        volume = self.volume
        if volume is not None:
            volume = replace(volume, nodes=numbers[volume.nodes].astype(np.int32))
        corners = numbers[self.corners].astype(np.int32)
        return replace(self, points=kept, corners=corners, volume=volume)

    def mesh(self, points: Vertices) -> PolygonMesh:
        """Return the polygon mesh for points of shape (N, 3)."""
        return PolygonMesh(points[self.points], self.counts, self.corners, self.volume)


EMPTY, PIXEL, VOXEL = 0, 8, 11
CONVERSIONS: tuple[tuple[int, int, tuple[int, ...]], ...] = (
    (EMPTY, 1, (0,)),
    (POLY_VERTEX, 1, (0,)),
    (POLY_LINE, 3, (0, 1)),
    (STRIP, 5, (0, 1, 2)),
    (POLYGON, 5, (0, 1, 2)),
    (POLYGON, 9, (0, 1, 2, 3)),
    (PIXEL, 9, (0, 1, 3, 2)),
    (VOXEL, 12, (0, 1, 3, 2, 4, 5, 7, 6)),
)
"""Types that are converted: the old type, the new one, and the order of its points in the old."""

SPLIT_TYPES = (EMPTY, POLY_VERTEX, POLY_LINE, STRIP)
"""Types with any number of points, which are split: a new cell begins at each point that enough
points follow."""

TYPE_NAMES = {
    0: "empty cell", 1: "point", 2: "poly-vertex", 3: "line", 4: "polyline", 5: "triangle",
    6: "triangle strip", 7: "polygon of more than 4 corners", 8: "pixel", 9: "quad", 11: "voxel",
    12: "hexahedron", 30: "quadratic linear quad", 31: "quadratic linear wedge", 35: "cubic line",
    36: "quadratic polygon", 37: "triquadratic pyramid", 41: "convex point set", 42: "polyhedron",
    **dict.fromkeys(range(68, 75), "Lagrange cell"), **dict.fromkeys(range(75, 82), "Bézier cell"),
    POLYHEDRON: "polyhedron",
}  # fmt: skip
"""Names of the types that notes and messages list."""


_SURFACES: WeakValueDictionary[bytes, CellSurface] = WeakValueDictionary()
"""Surfaces in use by the digest of their cells, which are the same in most steps of a result."""


def cell_mesh(cells: Cells, n_points: int) -> CellSurface:
    """Return the surface of the cells, with the cells if some are solid and all can be stored.

    It is the same object for equal cells, as long as it is in use.

    Raises
    ------
    FormatError
        As `extract_surface`, or if the number of points differs from what the cells declare.
    """
    key = mesh_digest(n_points, cells.types, cells.counts, cells.points)
    if (surface := _SURFACES.get(key)) is None:
        surface = _SURFACES[key] = _cell_mesh(cells, n_points)
    return surface


def _cell_mesh(cells: Cells, n_points: int) -> CellSurface:
    if cells.counts.sum() != len(cells.points) or (cells.counts < 0).any():
        raise FormatError(
            f"cells declare {counted(cells.counts.sum(), 'point')}; the file has "
            f"{len(cells.points)}"
        )
    if not np.isin(cells.types, SOLIDS).any():
        return extract_surface(cells, n_points)
    new_cells, rows, changes = _convert_types(cells)
    is_known = (new_cells.types >= 0) & (new_cells.types < len(cell_sizes()))
    sizes = cell_sizes()[np.where(is_known, new_cells.types, 0)]
    is_stored = is_known & (sizes == new_cells.counts)
    if not is_stored.all():
        kinds = np.unique(new_cells.types[~is_stored]).tolist()
        surface = extract_surface(cells, n_points)
        return replace(surface, unstored=tuple(_type_text(kind) for kind in kinds))
    try:
        nodes = new_cells.points.astype(np.int32)
        volume = validated_cells(VolumeCells(new_cells.types, nodes), n_points)
        polygons = volume.surface(n_points)
    except InvalidInputError as error:
        raise FormatError(str(error)) from None
    return CellSurface(
        polygons.sizes.astype(np.int64),
        join_triangles(polygons.sizes, polygons.triangles),
        rows[polygons.owners],
        slice(None),
        volume=volume,
        volume_rows=rows if changes else None,
        changes=changes,
    )


def _type_text(kind: int) -> str:
    """Return the number and name of a type, such as "type 8 (pixel)"."""
    number = 42 if kind == POLYHEDRON else kind
    return f"type {number} ({TYPE_NAMES[kind]})" if kind in TYPE_NAMES else f"type {number}"


def _convert_types(cells: Cells) -> tuple[Cells, npt.NDArray[np.int64], tuple[str, ...]]:
    """Convert cells to types that can be stored, if possible.

    Returns
    -------
    Cells
    rows : int64 array of shape (N,)
        The original cell of each new one.
    changes : tuple of str
        Conversions of cell types, for notes.
    """
    if not np.isin(cells.types, [kind for kind, _, _ in CONVERSIONS]).any():
        return cells, np.arange(len(cells.types)), ()
    types, sizes, changes = cells.types.copy(), cells.counts.copy(), []
    n_parts = np.ones(len(types), np.int64)
    for kind, new_kind, order in CONVERSIONS:
        is_kind = cells.types == kind
        if kind not in SPLIT_TYPES:
            is_kind &= cells.counts == len(order)
        types[is_kind], sizes[is_kind] = new_kind, len(order)
        n_parts[is_kind] = np.maximum(0, cells.counts[is_kind] - len(order) + 1)
        is_reordered = list(order) != sorted(order)
        if n_changed := len(changed_parts := n_parts[is_kind & (is_reordered | (n_parts != 1))]):
            number = f"{changed_parts.sum()} of " if changed_parts.sum() != n_changed else ""
            cells_text = f"{counted(n_changed, 'cell')} of {_type_text(kind)}"
            changes.append(f"{cells_text} became {number}{_type_text(new_kind)}")
    rows = np.repeat(np.arange(len(types)), n_parts)
    part = np.arange(len(rows)) - np.repeat(np.cumsum(n_parts) - n_parts, n_parts)
    starts = np.cumsum(cells.counts) - cells.counts
    kinds, sizes = cells.types[rows], sizes[rows]
    points = cells.points[ragged_indices(starts[rows] + part, sizes)]
    first = np.cumsum(sizes) - sizes
    orders = [(kinds == kind, order) for kind, _, order in CONVERSIONS if kind in (PIXEL, VOXEL)]
    # Every second triangle of a strip is reversed to keep the orientation.
    for is_kind, order in [*orders, ((kinds == STRIP) & (part % 2 == 1), (0, 2, 1))]:
        cell_starts = first[is_kind & (sizes == len(order)), None]
        points[cell_starts + np.arange(len(order))] = points[cell_starts + np.array(order)]
    return Cells(types[rows], sizes, points), rows, tuple(changes)


def join_cells(
    mesh_cells: Sequence[VolumeCells | None], starts: npt.NDArray[np.int64]
) -> VolumeCells | None:
    """Return the cells of several meshes whose vertices follow each other; None without any.

    Raises
    ------
    FormatError
        If only some of them have cells.
    """
    present = [cells for cells in mesh_cells if cells is not None]
    if not present:
        return None
    if len(present) < len(mesh_cells):
        raise FormatError(
            "has meshes with solid cells and others without, which are not merged; read one with ",
            Keyword("object"),
        )
    return VolumeCells(
        np.concatenate([cells.types for cells in present]),
        np.concatenate(
            [cells.nodes + np.int32(start) for cells, start in zip(present, starts, strict=False)]
        ),
    )


def written_cells(faces: Faces, surface: Surface) -> Cells:
    """Return the cells of a mesh, or its faces as triangles, quads and polygons."""
    if surface.cells is not None:
        volume = surface.cells
        return Cells(volume.types, np.diff(volume.starts), volume.nodes.astype(np.int64))
    counts = surface.sizes(len(faces)).astype(np.int64)
    types = np.full(len(counts), POLYGON, np.uint8)
    types[counts == 3], types[counts == 4] = 5, 9  # which more programs support
    return Cells(types, counts, join_triangles(counts, faces).astype(np.int64))


def extract_surface(cells: Cells, n_points: int) -> CellSurface:
    """Return the surface of the cells in cell order; point and line cells are ignored.

    Raises
    ------
    FormatError
        If a cell type is unknown, a cell has too few points or a point index is out of range,
        or there is no surface.
    """
    starts = np.cumsum(cells.counts) - cells.counts
    none = [(np.empty(0, np.int64),) * 3]
    faces = [_faces_of_type(cells, starts, int(kind)) for kind in np.unique(cells.types)]
    counts, corners, owners = map(np.concatenate, zip(*(faces or none), strict=True))
    is_solid_cell = np.isin(cells.types, SOLIDS)
    is_flat_cell = ~np.isin(cells.types, POINTS_AND_LINES) & ~is_solid_cell & (cells.types != STRIP)
    is_solid, n_corners = is_solid_cell[owners], np.bincount(owners, counts, len(cells.types))
    # Building a mesh without positions validates the indices before they are used for lookups.
    polygon_mesh(np.empty((n_points, 0)), counts, corners)
    surface_faces = np.sort(
        np.concatenate([np.flatnonzero(~is_solid), _boundary_faces(counts, corners, is_solid)])
    )
    order = surface_faces[np.argsort(owners[surface_faces], kind="stable")]
    first = np.cumsum(counts) - counts
    corners = corners[ragged_indices(first[order], counts[order])]
    points: npt.NDArray[np.int64] | slice = slice(None)
    if is_solid.any():
        points, corners = np.unique(corners, return_inverse=True)
    if len(order) == 0:
        raise FormatError("contains solid cells without a boundary; there is no surface")
    return CellSurface(
        counts[order],
        corners.astype(np.int32),
        owners[order],
        points,
        int(is_solid_cell.sum()),
        0 if isinstance(points, slice) else n_points - len(points),
        has_points_or_lines=bool(np.isin(cells.types, POINTS_AND_LINES).any()),
        has_middle_nodes=bool((is_flat_cell & (cells.counts > n_corners)).any()),
    )


_Faces = tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], npt.NDArray[np.int64]]


def _faces_of_type(cells: Cells, starts: npt.NDArray[np.int64], kind: int) -> _Faces:
    """Corner counts, corners and source cells of the faces of all cells of one type."""
    cell_numbers = np.flatnonzero(cells.types == kind)
    counts, first = cells.counts[cell_numbers], starts[cell_numbers]
    if kind in POINTS_AND_LINES:
        return (np.empty(0, np.int64),) * 3
    if kind in (POLYGON, QUADRATIC_POLYGON):
        counts = counts // 2 if kind == QUADRATIC_POLYGON else counts  # corners are first
        return counts, cells.points[ragged_indices(first, counts)], cell_numbers
    if kind == POLYHEDRON:
        face_starts, owners = _face_starts(cells.points, first, counts, cell_numbers)
        sizes = cells.points[face_starts]
        return sizes, cells.points[ragged_indices(face_starts + 1, sizes)], owners
    if kind == STRIP:
        return _strips(cells.points, first, counts, cell_numbers)
    if not (faces := CELL_FACES.get(kind)):
        raise FormatError(
            f"contains cells of unsupported {_type_text(kind)}; export a surface instead"
        )
    min_points = 1 + max(max(face) for face in faces)
    if (counts < min_points).any():
        raise FormatError(
            f"a cell of type {kind} has {counted(counts.min(), 'point')}; it needs {min_points}"
        )
    rows = [(cells.points[first[:, None] + np.array(face)], len(face)) for face in faces]
    sizes = np.tile([size for _, size in rows], len(cell_numbers))
    corners = np.concatenate([row for row, _ in rows], axis=1).ravel()
    return sizes.astype(np.int64), corners, np.repeat(cell_numbers, len(faces))


def _face_starts(
    points: npt.NDArray[np.int64],
    first: npt.NDArray[np.int64],
    counts: npt.NDArray[np.int64],
    cells: npt.NDArray[np.int64],
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return where the faces of polyhedra begin in their points, and the cell of each face.

    The order is the first face of each polyhedron, the second, and so on.
    """
    if (counts < 1).any():
        raise FormatError("a polyhedron is empty")
    n_left, starts, stops = points[first], first + 1, first + counts
    face_starts, owners = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
    while len(cells := cells[is_left := n_left > 0]):
        n_left, starts, stops = n_left[is_left] - 1, starts[is_left], stops[is_left]
        sizes = points[np.minimum(starts, stops - 1)]
        if (sizes < 3).any() or (starts + 1 + sizes > stops).any():
            raise FormatError("a polyhedron has a face with fewer than three corners")
        _validate_face_sizes(sizes)
        face_starts.append(starts)
        owners.append(cells)
        starts = starts + 1 + sizes
    return np.concatenate(face_starts), np.concatenate(owners)


def _validate_face_sizes(sizes: Integers) -> None:
    """Raise an error if a face of a polyhedron has more corners than supported."""
    if (sizes > MAX_FACE_CORNERS).any():
        raise FormatError(
            f"a polyhedron has a face of {sizes.max()} corners; up to {MAX_FACE_CORNERS} are "
            "supported"
        )


def _strips(
    points: npt.NDArray[np.int64],
    first: npt.NDArray[np.int64],
    counts: npt.NDArray[np.int64],
    cells: npt.NDArray[np.int64],
) -> _Faces:
    """Split strips into triangles; every second one is reversed to keep the orientation."""
    if (counts < 3).any():
        raise FormatError(f"a triangle strip has {counted(counts.min(), 'point')}; it needs three")
    begin = ragged_indices(first, counts - 2)
    is_reversed = (begin - np.repeat(first, counts - 2)) % 2
    corners = np.stack(
        [points[begin], points[begin + 1 + is_reversed], points[begin + 2 - is_reversed]]
    )
    sizes = np.full(len(begin), 3, np.int64)
    return sizes, corners.T.ravel(), np.repeat(cells, counts - 2)


def _boundary_faces(
    counts: npt.NDArray[np.int64], corners: npt.NDArray[np.int64], is_solid: npt.NDArray[np.bool_]
) -> npt.NDArray[np.int64]:
    """Indices of the faces of solid cells that no other solid cell shares."""
    faces = np.flatnonzero(is_solid)
    if len(faces) == 0:
        return faces
    first = np.cumsum(counts) - counts
    columns = np.arange(counts[faces].max())
    is_corner = columns < counts[faces, None]
    corner_rows = np.where(is_corner, first[faces, None] + columns, 0)
    keys = np.sort(np.where(is_corner, corners[corner_rows], -1), axis=1)
    order = np.lexsort(keys.T)
    is_same = (keys[order[1:]] == keys[order[:-1]]).all(axis=1)
    is_shared = np.concatenate([[False], is_same]) | np.concatenate([is_same, [False]])
    boundary: npt.NDArray[np.int64] = faces[order[~is_shared]]
    return boundary
