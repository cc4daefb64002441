"""Polygon meshes as files store them, validated and compared between frames."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.kernel.polygons import triangulate
from meshreel.model.cells import Cells
from meshreel.model.geometry.polygons import Integers
from meshreel.model.notes import Notes
from meshreel.model.sequence import Faces, Vertices
from meshreel.model.surface import Domain, Surface
from meshreel.runtime.counting import counted


class EmptyMeshError(FormatError):
    """A mesh without vertices or faces."""


@dataclass(frozen=True, eq=False)
class PolygonMesh:
    """One frame of a file: vertices in file order, faces of any size."""

    vertices: Vertices
    """float32 or float64 array of shape (V, 3). Positions in model units; not checked to be finite.
    """
    counts: npt.NDArray[np.int64]
    """int64 array of shape (N,). Number of corners of each face, at least 3."""
    corners: npt.NDArray[np.int32]
    """int32 array of shape (sum of counts,). Vertex indices of all faces, concatenated, in 0..V-1.
    """
    cells: Cells | None = None
    """Cells of a volume mesh, whose surface are the faces. Default: none."""

    @property
    def n_items(self) -> dict[Domain, int]:
        """Number of vertices, faces, corners and cells."""
        n_cells = 0 if self.cells is None else self.cells.n_cells
        counts = len(self.vertices), len(self.counts), len(self.corners), n_cells
        return dict(zip(Domain, counts, strict=True))

    def with_polygons(self, surface: Surface) -> Surface:
        """Return a surface with the sizes of these faces, and the cells."""
        return replace(surface, face_sizes=self.counts.astype(np.int32), cells=self.cells)

    def items_of_corners(self, domain: Domain) -> npt.NDArray[np.integer]:
        """Return the vertex, face or corner to which each corner belongs, of shape (C,)."""
        if domain is Domain.VERTEX:
            return self.corners
        items = np.arange(self.n_items[domain])
        return items if domain is Domain.CORNER else np.repeat(items, self.counts)

    def has_faces_of(self, other: "PolygonMesh") -> bool:
        """Whether both frames have the same number of vertices and the same faces and cells."""
        pairs: list[tuple[npt.NDArray[Any], npt.NDArray[Any]]] = [
            (self.counts, other.counts),
            (self.corners, other.corners),
        ]
        if self.cells is None or other.cells is None:
            if self.cells is not other.cells:
                return False
        elif self.cells is not other.cells:
            pairs += [
                (self.cells.types, other.cells.types),
                (self.cells.nodes, other.cells.nodes),
            ]
        return len(self.vertices) == len(other.vertices) and all(
            first is second or np.array_equal(first, second) for first, second in pairs
        )


def polygon_mesh(
    vertices: Vertices,
    counts: Integers,
    corners: Integers,
    *,
    location: Callable[[int], str] = "face {}".format,
    file_index: Callable[[int], Any] | None = None,
    allowed: str = "",
) -> PolygonMesh:
    """Return a `PolygonMesh` after validating corner counts and vertex indices.

    Parameters
    ----------
    vertices, counts, corners : arrays
        As in `PolygonMesh`, but of any integer type and unchecked.
    location : function of a face number
        Describes the location of a face for messages.
    file_index : function of a corner number, optional
        Returns the index as written in the file, if it differs from `corners`.
    allowed : str, optional
        Describes the valid indices; default "0..V-1".

    Raises
    ------
    EmptyMeshError
        If vertices or faces are missing.
    FormatError
        If a face has fewer than three corners, or an index is out of range.
    """
    if len(vertices) == 0 or len(counts) == 0:
        raise EmptyMeshError(
            f"holds {counted(len(vertices), 'vertex')} and {counted(len(counts), 'face')}; a "
            "triangle mesh needs both"
        )
    is_small = counts < 3
    if is_small.any():
        face = int(np.argmax(is_small))
        raise FormatError(
            f"{location(face)}: a face needs at least three corners; got {counts[face]}; remove it"
        )
    is_outside = (corners < 0) | (corners >= len(vertices))
    if is_outside.any():
        corner = int(np.argmax(is_outside))
        face = int(np.searchsorted(np.cumsum(counts), corner, side="right"))
        raise FormatError(
            f"{location(face)}: uses vertex {file_index(corner) if file_index else corners[corner]}"
            f"; indices must be in {allowed or f'0..{len(vertices) - 1}'}"
        )
    return PolygonMesh(vertices, counts.astype(np.int64), corners.astype(np.int32))


def reversed_corners(counts: Integers, *, keeps_first: bool = False) -> npt.NDArray[np.int64]:
    """Return the permutation that reverses the corners of each face; it is its own inverse.

    Parameters
    ----------
    counts : integer array of shape (N,)
        Corners of each face.
    keeps_first : bool, default False
        Whether faces keep their first corner, as in USD. Otherwise it becomes the last, as Blender
        does for Alembic.
    """
    lengths = np.asarray(counts, np.int64)
    sizes, starts = (np.repeat(rows, lengths) for rows in (lengths, np.cumsum(lengths) - lengths))
    offsets: npt.NDArray[np.int64] = starts - np.arange(len(starts)) - (not keeps_first)
    return starts + offsets % sizes


def triangulated(mesh: PolygonMesh, notes: Notes) -> Faces:
    """Return the triangles of the faces, of shape (M, 3); note polygons whose triangles overlap."""
    if mesh.cells is not None:
        return mesh.cells.surface(len(mesh.vertices)).triangles
    faces, n_overlapping = triangulate(mesh.counts, mesh.corners, mesh.vertices)
    if n_overlapping:
        text = f"triangles overlap in {counted(n_overlapping, 'polygon')} with crossing sides"
        notes.changed("overlapping triangles", text)
    return faces


def describe_triangles(counts: Integers) -> str:
    """Return a sentence on polygons that are triangulated; empty if all faces are triangles."""
    n_polygons = int((counts > 3).sum())
    if n_polygons == 0:
        return ""
    kind = "quad" if counts.max() == 4 else "polygon"
    return f"triangulated {counted(n_polygons, kind)}, the same way in every frame"
