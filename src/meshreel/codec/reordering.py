"""Joining of segments whose meshes differ only in the order of their vertices and faces.

Some programs write each frame of an unchanged mesh in another order, which would begin a segment.
Vertices are labeled by properties that do not depend on the order: values of attributes, positions
if the mesh rests, and then the labels of neighbors, until all labels of a mesh are different.
Vertices with equal labels match.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers, rows_as_bytes
from meshreel.codec.connectivity.order import inverse_permutation
from meshreel.model.geometry.triangles import lowest_rotation, matching_corners
from meshreel.model.matching.corners import is_of_triangles
from meshreel.model.notes import Note, NoteKind
from meshreel.model.sequence import Faces, FrameSource, MeshSequence, Vertices, frames_of
from meshreel.model.surface import Attribute, Domain, Surface
from meshreel.model.tracks import Track, TrackSource, error_bound_of
from meshreel.model.validation import hand_over

Labels = npt.NDArray[np.uint64]


@dataclass(frozen=True, eq=False)
class _Match:
    """The vertices, faces and corners of a mesh that correspond to those of another one."""

    vertices: Integers
    faces: Integers
    corners: Integers

    def of(self, domain: Domain) -> Integers:
        """Return the matches of the items of a domain."""
        items = {Domain.VERTEX: self.vertices, Domain.FACE: self.faces}
        return items.get(domain, self.corners)


def without_reordering(sequence: MeshSequence, order: str | None) -> MeshSequence:
    """Return the sequence with segments joined whose meshes differ only in their order.

    Nothing is joined if an order is kept. Faces, attributes and the positions of a resting mesh
    must determine the correspondence of vertices uniquely: a symmetric mesh without attributes is
    not matched. Attributes, groups and the kinds of tracks must be equal.

    Parameters
    ----------
    order : {"keep", "vertices", "drop"}, optional
        The encoder's option.
    """
    if order != "drop" or sequence.n_segments == 1:
        return sequence
    joined: list[FrameSource] = [sequence.segments[0]]
    for segment in sequence.segments[1:]:
        match = _match(joined[-1], segment)
        if match is None:
            joined.append(segment)
        else:
            joined[-1] = _appended(joined[-1], segment, match)
    if len(joined) == sequence.n_segments:
        return sequence
    return MeshSequence.of_segments(joined, sequence.name, sequence.timing)


def joined_note(original: MeshSequence, joined: MeshSequence) -> Note | None:
    """Return a note on segments that `without_reordering` joined; None if it joined none."""
    n_original, n_joined = original.n_segments, joined.n_segments
    if n_original == n_joined:
        return None
    text = (
        f"joined {n_original} segments to {n_joined}, as only the order of their vertices and "
        "faces differs, which is not kept"
    )
    return Note(NoteKind.SEGMENTS, "joined segments", text=text)


def _match(first: FrameSource, second: FrameSource) -> _Match | None:
    """Return the items of the second mesh for those of the first; None if they are not unique."""
    if (first.n_verts, len(first.faces)) != (second.n_verts, len(second.faces)):
        return None
    surfaces = first.surface, second.surface
    tracks = _properties_of_tracks(first.tracks)
    if not all(map(_is_joinable, surfaces)):
        return None
    if tracks is None or tracks != _properties_of_tracks(second.tracks):
        return None
    if np.array_equal(first.faces, second.faces):
        return None  # the caller made them segments, for instance shots
    labels = _labels_of_values(first, second)
    vertices = None if labels is None else _matching_vertices(first.faces, second.faces, *labels)
    match = None if vertices is None else _matching_items(first.faces, second.faces, vertices)
    return match if match is not None and _is_same_surface(*surfaces, match) else None


def _is_joinable(surface: Surface) -> bool:
    """Whether a surface has no polygons, cells, parts or hard edges, which refer to the order."""
    return is_of_triangles(surface) and surface.hard_edges is None


def _properties_of_tracks(
    tracks: Mapping[str, TrackSource],
) -> dict[str, tuple[object, ...]] | None:
    """Return the properties that joined tracks share; None if a track is not of vertices."""
    if any(track.domain is not Domain.VERTEX for track in tracks.values()):
        return None
    return {
        name: (track.kind, track.unit, track.dtype, track.shape[2])
        for name, track in tracks.items()
    }


def _labels_of_values(first: FrameSource, second: FrameSource) -> tuple[Labels, Labels] | None:
    """Return equal labels for vertices with equal values; None if attributes do not correspond."""
    meshes = first, second
    labels = np.zeros(first.n_verts, np.uint64), np.zeros(first.n_verts, np.uint64)
    pairs = _attribute_pairs(first.surface, second.surface)
    if pairs is None:
        return None
    for pair in pairs:
        domain = pair[0].domain
        if domain is Domain.FACE:
            continue
        ids = _row_ids(*(attribute.per_item() for attribute in pair))
        for mesh_labels, mesh, item_ids in zip(labels, meshes, ids, strict=True):
            is_of_vertices = domain is Domain.VERTEX
            vertices = np.arange(len(mesh_labels)) if is_of_vertices else mesh.faces.ravel()
            np.add.at(mesh_labels, vertices, _hashed(item_ids))
            mesh_labels[:] = _hashed(mesh_labels)
    ids = _row_ids(first.read(first.n_frames - 1, first.n_frames)[0], second.read(0, 1)[0])
    if np.array_equal(np.sort(ids[0]), np.sort(ids[1])):  # the mesh rests
        for mesh_labels, vertex_ids in zip(labels, ids, strict=True):
            mesh_labels += _hashed(vertex_ids)
    return labels


def _row_ids(first: Vertices, second: Vertices) -> tuple[Labels, Labels]:
    """Return ids of the rows of two arrays; only equal rows have equal ids."""
    if first.dtype != second.dtype or first.shape != second.shape:
        return np.zeros(len(first), np.uint64), np.ones(len(second), np.uint64)
    _, ids = np.unique(rows_as_bytes(np.concatenate([first, second])), return_inverse=True)
    ids_of_first, ids_of_second = np.split(ids.astype(np.uint64), 2)
    return ids_of_first, ids_of_second


def _matching_vertices(
    faces: Faces, others: Faces, labels: Labels, other_labels: Labels
) -> Integers | None:
    """Return the vertex of the second mesh for each vertex of the first; None if ambiguous.

    Labels are refined by those of the neighbors in each face until all vertices of a mesh have
    different labels, or another refinement distinguishes no more of them (color refinement).
    """
    n_last = 0
    while np.array_equal(np.sort(labels), np.sort(other_labels)):
        n_distinct = len(np.unique(labels))
        if n_distinct == len(labels):
            vertices = np.empty(len(labels), np.int64)
            vertices[np.argsort(labels)] = np.argsort(other_labels)
            return vertices
        if n_distinct <= n_last:
            return None
        n_last = n_distinct
        labels, other_labels = _with_neighbors(faces, labels), _with_neighbors(others, other_labels)
    return None


def _with_neighbors(faces: Faces, labels: Labels) -> Labels:
    """Return labels that also depend on those of the next two corners in each face of a vertex."""
    sums = np.zeros_like(labels)
    for corner in range(3):
        next_labels, last_labels = (labels[faces[:, (corner + turn) % 3]] for turn in (1, 2))
        np.add.at(sums, faces[:, corner], _hashed(next_labels + _hashed(last_labels)))
    return _hashed(labels + _hashed(sums))


def _hashed(values: Labels) -> Labels:
    """Hash 64-bit numbers by the finalizer of SplitMix64."""
    mixed = values + np.uint64(0x9E3779B97F4A7C15)
    mixed = (mixed ^ (mixed >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return mixed ^ (mixed >> np.uint64(31))


def _matching_items(faces: Faces, others: Faces, vertices: Integers) -> _Match | None:
    """Match faces and corners too, given the vertices; None if faces differ or repeat."""
    n_verts = len(vertices)
    renumbered = inverse_permutation(vertices)[others]  # in the vertices of the first mesh
    matches, turns = np.divmod(matching_corners(faces, renumbered, n_verts), 3)
    corners = 3 * matches[:, np.newaxis] + (turns[:, np.newaxis] + np.arange(3)) % 3
    n_distinct = len(np.unique(lowest_rotation(faces, n_verts)[0], axis=0))
    if n_distinct < len(faces) or not np.array_equal(renumbered.ravel()[corners], faces):
        return None
    return _Match(vertices, matches, corners.ravel())


def _attribute_pairs(first: Surface, second: Surface) -> list[tuple[Attribute, Attribute]] | None:
    """Pair the attributes of two surfaces; None unless names, kinds and domains are equal."""
    descriptions = [
        [(attribute.name, attribute.kind, attribute.domain) for attribute in surface.attributes]
        for surface in (first, second)
    ]
    if descriptions[0] != descriptions[1]:
        return None
    return list(zip(first.attributes, second.attributes, strict=True))


def _is_same_surface(first: Surface, second: Surface, match: _Match) -> bool:
    """Whether attributes, groups and materials of two meshes are equal after matching."""
    pairs = _attribute_pairs(first, second)
    if pairs is None:
        return False
    for attribute, other in pairs:
        values = attribute.per_item()
        other_values = other.per_item()[match.of(attribute.domain)]
        if values.dtype != other_values.dtype or values.tobytes() != other_values.tobytes():
            return False
    groups = [(row.name, row.labels, row.numbers.tobytes()) for row in first.groups]
    other_groups = [
        (row.name, row.labels, row.numbers[match.faces].tobytes()) for row in second.groups
    ]
    images, other_images = ([image.data for image in row.images] for row in (first, second))
    return groups == other_groups and first.materials == second.materials and images == other_images


def _appended(first: FrameSource, second: FrameSource, match: _Match) -> MeshSequence:
    """Return the frames of both, in the order of the first."""
    loaded, others = (frames_of(part, range(part.n_frames)) for part in (first, second))
    tracks = {}
    for name, track in loaded.tracks.items():
        values = others.tracks[name].values[:, match.vertices]
        joined = hand_over(np.concatenate([track.values, values]))
        bound = error_bound_of(track, others.tracks[name])
        tracks[name] = Track(joined, track.domain, track.kind, track.unit, bound)
    vertices = hand_over(np.concatenate([loaded.vertices, others.vertices[:, match.vertices]]))
    error_bound = error_bound_of(loaded, others)
    return loaded.replace(vertices=vertices, tracks=tracks, error_bound=error_bound)
