"""Tracks of corners whose values corners of a vertex share: as ones of vertices, or of rows."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.codec.choices import Order
from meshreel.codec.connectivity.order import inverse_permutation
from meshreel.codec.corner_rows import (
    CornerRows,
    numbered_rows,
    write_corner_rows,
)
from meshreel.codec.reel.normative.graphs import ItemGraph, row_graph
from meshreel.codec.source import CodedMesh
from meshreel.codec.surface.rows import distinct_rows
from meshreel.codec.tracks import Sharing
from meshreel.model.geometry.fans import join_fans
from meshreel.model.surface import Domain
from meshreel.model.tracks import DerivedTrack, TrackKind, TrackSource, track_blocks

Values = npt.NDArray[Any]
Integers = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class SharedTrack(DerivedTrack):
    """A track of corners by the values that corners share, a `TrackSource`.

    Attributes
    ----------
    whole : TrackSource
        Of all N corners.
    corners : integer array of shape (n,)
        A corner that has each value.
    is_unused : bool array of shape (n,)
        Whether a value is of no corner; it is that of the first, of normals 0.
    sharing : Sharing
    graph : ItemGraph
        Of the n vertices or rows.
    order : int64 array of shape (n,), or None
        As of `TrackCoder`.
    rows : bytes
        What rows there are, as TRACK has it.
    vertex_of_row : integer array of shape (n,), or None
        As it goes out, where values are of rows.
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
        """Frames, vertices or rows, and numbers of each value: (T, n, C)."""
        n_frames, _, n_columns = self.whole.shape
        return n_frames, len(self.corners), n_columns

    def read(self, start: int, stop: int) -> Values:
        """Values of frames start..stop - 1, of shape (stop - start, n, C)."""
        found = self.whole.read(start, stop).take(self.corners, axis=1)
        if self.kind is TrackKind.NORMAL:
            found[:, self.is_unused] = 0
        return found


def shared_track(track: TrackSource, mesh: CodedMesh) -> SharedTrack | None:
    """A track of corners by the values that these share in all frames, bit for bit.

    None if each corner has values of its own, or the track is not of corners that go out in their
    order.
    """
    if track.domain is not Domain.CORNER or mesh.order_kept is not Order.KEEP:
        return None
    sizes = mesh.surface.sizes(len(mesh.output_faces))
    vertices = join_fans(sizes, mesh.output_faces).astype(np.int64)
    groups = equal_corners(track, vertices)
    rows = numbered_rows(groups, mesh.output_order[vertices], mesh.n_verts)
    if rows.n_rows >= len(vertices):
        return None
    if rows.n_rows == mesh.n_verts:
        corners, is_unused = _first_corners(vertices, mesh.n_verts)
        graph = ItemGraph(mesh.faces, mesh.n_verts)
        return SharedTrack(track, corners, is_unused, Sharing.VERTICES, graph, mesh.order)
    return _by_rows(track, rows, vertices, mesh)


def equal_corners(track: TrackSource, vertices: Integers) -> Integers:
    """Groups of corners of a vertex whose values are equal in all frames, numbered from 0 on.

    Parameters
    ----------
    track : TrackSource
    vertices : integer array of shape (N,)
        Of each corner.
    """
    _, groups = np.unique(vertices, return_inverse=True)
    first = _first_of(groups)
    for _, values in track_blocks(track):
        for frame in np.ascontiguousarray(values).view(f"u{values.itemsize}"):
            if len(first) == len(groups):
                return groups
            is_other = (frame != frame[first[groups]]).any(axis=1)
            if is_other.any():
                others = distinct_rows(frame[is_other], groups[is_other])[1]
                groups[is_other] = len(first) + others
                first = _first_of(groups)
    return groups


def _first_of(groups: Integers) -> Integers:
    """The first corner of each group."""
    return _first_corners(groups, int(groups.max(initial=-1)) + 1)[0]


def _first_corners(places: Integers, n_places: int) -> tuple[Integers, npt.NDArray[np.bool_]]:
    """The first corner at each place, and which places have none, for which it is corner 0."""
    found = np.full(n_places, -1, np.int64)
    found[places[::-1]] = np.arange(len(places))[::-1]
    return np.maximum(found, 0), found < 0


def _by_rows(
    track: TrackSource, rows: CornerRows, vertices: Integers, mesh: CodedMesh
) -> SharedTrack:
    corners, is_unused = _first_corners(rows.of_corners, rows.n_rows)
    return SharedTrack(
        track,
        corners,
        is_unused,
        Sharing.ROWS,
        row_graph(rows, mesh.output_faces, mesh.surface, mesh.n_verts),
        None,
        write_corner_rows(rows, mesh.output_order[vertices], mesh.n_verts),
        _vertices_of_rows(rows, vertices, mesh.output_order),
    )


def _vertices_of_rows(rows: CornerRows, vertices: Integers, order: Integers) -> Integers:
    """The vertex, as it goes out, of each row.

    Parameters
    ----------
    rows : CornerRows
    vertices : integer array of shape (N,)
        Of corners, as they go out.
    order : integer array of shape (V,)
        Internal number of each vertex that goes out.
    """
    found = np.empty(rows.n_rows, np.int64)
    found[: len(order)] = inverse_permutation(order)
    found[rows.of_corners] = vertices
    return found
