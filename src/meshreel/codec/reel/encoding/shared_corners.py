"""Tracks of corners that share values, stored as tracks of vertices or of rows."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers, Values
from meshreel.codec.bitstream.layout import Order
from meshreel.codec.connectivity.order import inverse_permutation
from meshreel.codec.corner_rows import number_rows, write_corner_rows
from meshreel.codec.reel.normative.mesh import ItemGraph, item_graph
from meshreel.codec.source import CodedMesh
from meshreel.codec.surface.rows import distinct_rows
from meshreel.codec.tracks import Sharing
from meshreel.model.geometry.polygons import join_triangles
from meshreel.model.surface import Domain
from meshreel.model.tracks import KIND_ROWS, DerivedTrack, TrackSource, track_blocks


@dataclass(frozen=True, eq=False)
class SharedTrack(DerivedTrack):
    """A track of corners with one value per vertex or row, a `TrackSource`.

    Attributes
    ----------
    whole : TrackSource
        Values of all N corners.
    corners : integer array of shape (n,)
        Index of one corner with each value.
    is_unused : bool array of shape (n,)
        Whether each vertex has no corner; its value is that of corner 0, or the normal 0.
    sharing : Sharing
    graph : ItemGraph
        Graph of the n vertices or rows.
    order : int64 array of shape (n,), or None
        As in `TrackCoder`.
    rows : bytes
        The rows, as in the section TRACK.
    vertex_of_row : integer array of shape (n,), or None
        Decoded vertex of each row.
    """

    corners: Integers
    is_unused: npt.NDArray[np.bool_]
    sharing: Sharing
    graph: ItemGraph
    order: Integers | None
    rows: bytes = b""
    vertex_of_row: Integers | None = None

    @property
    def shape(self) -> tuple[int, int, int]:
        """Frames, vertices or rows, and columns: (T, n, C)."""
        n_frames, _, n_columns = self.whole.shape
        return n_frames, len(self.corners), n_columns

    def read(self, start: int, stop: int) -> Values:
        """Read values of frames start..stop - 1, of shape (stop - start, n, C)."""
        values = self.whole.read(start, stop).take(self.corners, axis=1)
        if KIND_ROWS[self.kind].is_direction:
            values[:, self.is_unused] = 0
        return values


def shared_track(track: TrackSource, mesh: CodedMesh) -> SharedTrack | None:
    """Return the values that corners of a track share, bit by bit in all frames.

    None if no corners share values, or the track is not one of corners in the given order.
    """
    if track.domain is not Domain.CORNER or mesh.order_kept is not Order.KEEP:
        return None
    sizes = mesh.surface.sizes(len(mesh.output_faces))
    vertices = join_triangles(sizes, mesh.output_faces).astype(np.int64)
    groups = equal_corners(track, vertices)
    rows = number_rows(groups, mesh.output_order[vertices], mesh.n_verts)
    if rows.n_rows >= len(vertices):
        return None
    if rows.n_rows == mesh.n_verts:
        corners, is_unused = _first_corners(vertices, mesh.n_verts)
        graph = ItemGraph(mesh.links, mesh.n_verts)
        return SharedTrack(track, corners, is_unused, Sharing.VERTICES, graph, mesh.order)
    corners, is_unused = _first_corners(rows.of_corners, rows.n_rows)
    vertex_of_row = np.empty(rows.n_rows, np.int64)
    vertex_of_row[: mesh.n_verts] = inverse_permutation(mesh.output_order)
    vertex_of_row[rows.of_corners] = vertices
    return SharedTrack(
        track,
        corners,
        is_unused,
        Sharing.ROWS,
        item_graph(Domain.CORNER, mesh.output_faces, mesh.surface, mesh.n_verts, rows),
        None,
        write_corner_rows(rows, mesh.output_order[vertices], mesh.n_verts),
        vertex_of_row,
    )


def equal_corners(track: TrackSource, vertices: Integers) -> Integers:
    """Number the groups of corners of a vertex that have equal values in all frames.

    Returns the group of each corner; `vertices` is the vertex of each corner, of shape (N,).
    """
    _, groups = np.unique(vertices, return_inverse=True)
    first = _first_of(groups)
    for _, values in track_blocks(track):
        for frame in np.ascontiguousarray(values).view(f"u{values.itemsize}"):
            if len(first) == len(groups):
                return groups
            differs = (frame != frame[first[groups]]).any(axis=1)
            if differs.any():
                groups[differs] = len(first) + distinct_rows(frame[differs], groups[differs])[1]
                first = _first_of(groups)
    return groups


def _first_of(groups: Integers) -> Integers:
    """Return the first corner of each group."""
    return _first_corners(groups, int(groups.max(initial=-1)) + 1)[0]


def _first_corners(items: Integers, n_items: int) -> tuple[Integers, npt.NDArray[np.bool_]]:
    """Return the first corner of each item, or corner 0, and which items have no corner."""
    corners = np.full(n_items, -1, np.int64)
    corners[items[::-1]] = np.arange(len(items))[::-1]
    return np.maximum(corners, 0), corners < 0
