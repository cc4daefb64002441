"""Splitting of a merged mesh into its parts."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.model.geometry.polygons import join_fans
from meshreel.model.sequence import Faces
from meshreel.model.surface import Attribute, Domain, FaceGroups, Int32s, Part, Surface


@dataclass(frozen=True, eq=False)
class PartMesh:
    """A part of a mesh as a separate mesh.

    Attributes
    ----------
    verts : slice
        Range of its vertices in the whole mesh.
    counts, corners : integer arrays
        Its faces as in `PolygonMesh`, indexing its own vertices.
    surface : Surface
        Its attributes, groups and hard edges, without parts and unused group labels.
    items : mapping of Domain to slice
        Ranges of its vertices, faces and corners in the whole mesh.
    """

    name: str
    verts: slice
    counts: npt.NDArray[np.int32]
    corners: npt.NDArray[np.int32]
    surface: Surface
    items: Mapping[Domain, slice]


def split_parts(faces: Faces, surface: Surface, n_verts: int, name: str) -> Iterator[PartMesh]:
    """Yield the parts of a mesh in order; the whole mesh under `name` if it has none.

    Faces never use vertices of another part, except in damaged streams; then the whole mesh is
    yielded as one part.
    """
    counts = surface.sizes(len(faces))
    corners = join_fans(counts, faces)
    parts = surface.parts or (Part(name, n_verts, len(counts)),)
    pieces = list(_pieces(parts, counts))
    owners = np.repeat(np.arange(len(parts)), [part.n_verts for part in parts])
    wanted = np.repeat(np.arange(len(parts)), [int(counts[p.faces].sum()) for p in pieces])
    if (owners[corners] != wanted).any():
        parts = (Part(name, n_verts, len(counts)),)
        pieces = list(_pieces(parts, counts))
    for part, piece in zip(parts, pieces, strict=True):
        own = corners[piece.corners] - np.int32(piece.verts.start)
        items = {domain: piece.of(domain) for domain in Domain}
        cut = _cut(surface, piece)
        yield PartMesh(part.name, piece.verts, counts[piece.faces], own, cut, items)


@dataclass(frozen=True)
class _Piece:
    """Ranges of a part in the whole mesh."""

    verts: slice
    faces: slice
    corners: slice

    def of(self, domain: Domain) -> slice:
        """Return the range of its items of a domain."""
        return {Domain.VERTEX: self.verts, Domain.FACE: self.faces, Domain.CORNER: self.corners}[
            domain
        ]


def _pieces(parts: Sequence[Part], counts: npt.NDArray[np.int32]) -> Iterator[_Piece]:
    ends = np.concatenate([[0], np.cumsum(counts, dtype=np.int64)])
    vertex = face = 0
    for part in parts:
        last_vertex, last_face = vertex + part.n_verts, face + part.n_faces
        yield _Piece(
            slice(vertex, last_vertex),
            slice(face, last_face),
            slice(int(ends[face]), int(ends[last_face])),
        )
        vertex, face = last_vertex, last_face


def _cut(surface: Surface, piece: _Piece) -> Surface:
    attributes = tuple(_cut_attribute(one, piece.of(one.domain)) for one in surface.attributes)
    groups = tuple(_cut_groups(one, piece.faces) for one in surface.groups)
    kept = tuple(one for one in groups if one.labels)
    return Surface(None, attributes, kept, hard_edges=_cut_edges(surface.hard_edges, piece.verts))


def _cut_edges(edges: Int32s | None, verts: slice) -> Int32s | None:
    if edges is None:
        return None
    is_own = (edges >= verts.start).all(axis=1) & (edges < verts.stop).all(axis=1)
    return edges[is_own] - np.int32(verts.start) if is_own.any() else None


def _cut_attribute(whole: Attribute, items: slice) -> Attribute:
    if whole.indices is None:
        return Attribute(whole.name, whole.kind, whole.domain, whole.values[items])
    rows, indices = np.unique(whole.indices[items], return_inverse=True)
    return Attribute(
        whole.name, whole.kind, whole.domain, whole.values[rows], indices.astype(np.int32)
    )


def _cut_groups(whole: FaceGroups, faces: slice) -> FaceGroups:
    used, numbers = np.unique(whole.numbers[faces], return_inverse=True)
    first = int(len(used) > 0 and used[0] == -1)
    labels = tuple(whole.labels[number] for number in used[first:])
    return FaceGroups(whole.name, labels, (numbers - first).astype(np.int32))
