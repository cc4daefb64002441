"""Splitting of a merged mesh into its parts, and their names."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from meshreel.formats.frames.shared_data import SharedData
from meshreel.model.geometry.hard_edges import RowNormals
from meshreel.model.geometry.polygons import join_triangles
from meshreel.model.sequence import Faces
from meshreel.model.surface import (
    SURFACE_DOMAINS,
    Attribute,
    Domain,
    FaceGroups,
    Int32s,
    Part,
    Surface,
)
from meshreel.model.tracks import TrackKind, TrackSource


@dataclass(frozen=True, eq=False)
class PartMesh:
    """A part of a mesh as a separate mesh."""

    name: str
    verts: slice
    """Range of its vertices in the whole mesh."""
    counts: npt.NDArray[np.int32]
    corners: npt.NDArray[np.int32]
    """Integer arrays. Its faces as in `PolygonMesh`, indexing its own vertices."""
    faces: Faces
    """int32 array of shape (M, 3). Their triangles."""
    surface: Surface
    """Its attributes, groups and hard edges, without parts and unused group labels."""
    items: Mapping[Domain, slice]
    """Mapping of Domain to slice. Ranges of its vertices, faces and corners in the whole mesh."""

    def writes_edge_normals(
        self, tracks: Mapping[str, TrackSource], segment_data: SharedData | None
    ) -> bool:
        """Return whether normals are computed from hard edges: not if a track has normals.

        With the data of several segments, any of them may have the hard edges.
        """
        if segment_data is None:
            has_edges = self.surface.hard_edges is not None
        else:
            has_edges = segment_data.has_hard_edges
        return has_edges and all(track.kind is not TrackKind.NORMAL for track in tracks.values())

    def edge_normals(self) -> RowNormals:
        """Return the computation of normals from faces and hard edges."""
        n_verts = self.verts.stop - self.verts.start
        return RowNormals(self.faces, self.counts, self.surface.hard_edges, n_verts)


def split_parts(faces: Faces, surface: Surface, n_verts: int, name: str) -> Iterator[PartMesh]:
    """Yield the parts of a mesh in order; the whole mesh under `name` if it has none.

    Faces never use vertices of another part, except in damaged streams; then the whole mesh is
    yielded as one part.
    """
    counts = surface.sizes(len(faces))
    corners = join_triangles(counts, faces)
    parts = surface.parts or (Part(name, n_verts, len(counts)),)
    items = _items(parts, counts)
    owners = np.repeat(np.arange(len(parts)), [part.n_verts for part in parts])
    n_corners = [item[Domain.CORNER].stop - item[Domain.CORNER].start for item in items]
    if (owners[corners] != np.repeat(np.arange(len(parts)), n_corners)).any():
        parts = (Part(name, n_verts, len(counts)),)
        items = _items(parts, counts)
    for part, part_items in zip(parts, items, strict=True):
        verts, polygons, part_corners = (part_items[domain] for domain in SURFACE_DOMAINS)
        triangles = slice(  # n - 2 for each polygon of n corners
            part_corners.start - 2 * polygons.start, part_corners.stop - 2 * polygons.stop
        )
        attributes = tuple(
            _slice_attribute(attribute, part_items[attribute.domain])
            for attribute in surface.attributes
        )
        groups = tuple(_slice_groups(group, polygons) for group in surface.groups)
        used_groups = tuple(group for group in groups if group.labels)
        edges = _slice_edges(surface.hard_edges, verts)
        first = np.int32(verts.start)
        yield PartMesh(
            part.name,
            verts,
            counts[polygons],
            corners[part_corners] - first,
            faces[triangles] - first,
            Surface(None, attributes, used_groups, hard_edges=edges),
            part_items,
        )


def _items(parts: Sequence[Part], counts: npt.NDArray[np.int32]) -> list[dict[Domain, slice]]:
    """Return the ranges of the vertices, faces and corners of each part in the whole mesh."""
    corner_ends = np.concatenate([[0], np.cumsum(counts, dtype=np.int64)])
    faces = np.cumsum([0, *(part.n_faces for part in parts)])
    ends = np.cumsum([0, *(part.n_verts for part in parts)]), faces, corner_ends[faces]
    ranges = (pairwise(end.tolist()) for end in ends)
    return [
        {domain: slice(*bounds) for domain, bounds in zip(SURFACE_DOMAINS, part, strict=True)}
        for part in zip(*ranges, strict=True)
    ]


def _slice_edges(edges: Int32s | None, verts: slice) -> Int32s | None:
    if edges is None:
        return None
    is_inside = ((edges >= verts.start) & (edges < verts.stop)).all(axis=1)
    return edges[is_inside] - np.int32(verts.start) if is_inside.any() else None


def _slice_attribute(whole: Attribute, items: slice) -> Attribute:
    if whole.indices is None:
        return Attribute(whole.name, whole.kind, whole.domain, whole.values[items])
    rows, indices = np.unique(whole.indices[items], return_inverse=True)
    return Attribute(
        whole.name, whole.kind, whole.domain, whole.values[rows], indices.astype(np.int32)
    )


def _slice_groups(whole: FaceGroups, faces: slice) -> FaceGroups:
    used, numbers = np.unique(whole.numbers[faces], return_inverse=True)
    first = int(len(used) > 0 and used[0] == -1)
    labels = tuple(whole.labels[number] for number in used[first:])
    return FaceGroups(whole.name, labels, (numbers - first).astype(np.int32))


def unique_name(name: str, used: set[str]) -> str:
    """Return the name, with a number appended if it is in use, and add it to `used`."""
    unique, number = name, 2
    while unique in used:
        unique, number = f"{name}_{number}", number + 1
    used.add(unique)
    return unique
