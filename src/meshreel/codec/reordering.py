"""Joining of segments whose meshes differ only in the order of their vertices and faces.

Some programs write each frame of an unchanged mesh in another order, which would begin a segment.
Vertices are labeled by properties that do not depend on the order: values of attributes, positions
if the mesh rests, and then the labels of neighbors, until all labels of a mesh are different.
Vertices with equal labels match.
"""

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers, rows_as_bytes
from meshreel.codec.connectivity.order import inverse_permutation
from meshreel.model.geometry.triangles import lowest_rotation, matching_corners
from meshreel.model.matching.corners import columns_at_corners, describe_surface, is_of_triangles
from meshreel.model.notes import Note, NoteKind
from meshreel.model.sequence import Faces, FrameSource, MeshSequence, frames_of
from meshreel.model.surface import Domain, Surface
from meshreel.model.tracks import TrackSource, concatenate_tracks, error_bound_of, track_like
from meshreel.model.validation import hand_over

Labels = npt.NDArray[np.uint64]
Rows = npt.NDArray[np.void]


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
    runs: list[list[FrameSource]] = []
    for segment in sequence.segments:
        ordered = _in_order_of(runs[-1][-1], segment) if runs else None
        if ordered is None:
            runs.append([segment])
        else:
            runs[-1].append(ordered)
    if len(runs) == sequence.n_segments:
        return sequence
    return MeshSequence.of_segments(list(map(_joined, runs)), sequence.name, sequence.timing)


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


def _in_order_of(first: FrameSource, second: FrameSource) -> MeshSequence | None:
    """Return the second segment with the mesh of the first; None if they do not match uniquely."""
    if (first.n_verts, len(first.faces)) != (second.n_verts, len(second.faces)):
        return None
    tracks = _properties_of_tracks(first.tracks)
    if tracks is None or tracks != _properties_of_tracks(second.tracks):
        return None
    surfaces = first.surface, second.surface
    # Polygons, cells, parts and hard edges refer to the order.
    if not all(is_of_triangles(one) and one.hard_edges is None for one in surfaces):
        return None
    if describe_surface(first.surface) != describe_surface(second.surface):
        return None
    if np.array_equal(first.faces, second.faces):
        return None  # the caller made them segments, for instance shots
    n_used = len(np.unique(first.faces))
    if first.surface.attributes and n_used < first.n_verts:
        return None  # values of unused vertices are at no corner
    values, other_values = (
        rows_as_bytes(np.zeros(one.faces.size, bool), *columns_at_corners(one.surface, one.faces))
        for one in (first, second)
    )
    labels = _labels(first, second, values, other_values)
    vertices = _matching_vertices(first.faces, second.faces, *labels)
    corners = None if vertices is None else _corners(first.faces, second.faces, vertices)
    if vertices is None or corners is None or (values != other_values[corners]).any():
        return None
    return in_order(second, {Domain.VERTEX: vertices}, first.faces, first.surface)


def in_order(
    source: FrameSource, numbers: Mapping[Domain, Integers], faces: Faces, surface: Surface
) -> MeshSequence:
    """Return a segment in another order, in memory, with the faces and the surface of that order.

    Parameters
    ----------
    numbers : mapping of Domain to integer array of shape (N,)
        Number in the source of each vertex, and of the items of other domains whose tracks are
        kept.
    """
    loaded = frames_of(source, range(source.n_frames))
    tracks = {
        name: track_like(track, hand_over(track.values[:, numbers[track.domain]]))
        for name, track in loaded.tracks.items()
        if track.domain in numbers
    }
    vertices = hand_over(loaded.vertices[:, numbers[Domain.VERTEX]])
    return loaded.replace(vertices=vertices, faces=faces, surface=surface, tracks=tracks)


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


def _labels(
    first: FrameSource, second: FrameSource, values: Rows, other_values: Rows
) -> tuple[Labels, Labels]:
    """Return labels of vertices; vertices with equal values at their corners have equal labels."""
    labels = np.zeros(first.n_verts, np.uint64), np.zeros(first.n_verts, np.uint64)
    of_corners = map(_hashed_rows, (values, other_values))
    for mesh_labels, mesh, hashes in zip(labels, (first, second), of_corners, strict=True):
        np.add.at(mesh_labels, mesh.faces.ravel(), hashes)
    frames = first.read(first.n_frames - 1, first.n_frames)[0], second.read(0, 1)[0]
    positions, others = (_hashed_rows(rows_as_bytes(frame)) for frame in frames)
    if np.array_equal(np.sort(positions), np.sort(others)):  # the mesh rests
        return labels[0] + positions, labels[1] + others
    return labels


def _hashed_rows(rows: Rows) -> Labels:
    """Hash the bytes of each row."""
    table = rows.view(np.uint8).reshape(len(rows), -1)
    words = np.pad(table, ((0, 0), (0, -table.shape[1] % 8))).view(np.uint64)
    hashes = np.zeros(len(rows), np.uint64)
    for column in words.T:
        hashes = _hashed(hashes + column)
    return hashes


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


def _corners(faces: Faces, others: Faces, vertices: Integers) -> Integers | None:
    """Return the matching corners, given the vertices; None if faces differ or repeat."""
    n_verts = len(vertices)
    renumbered = inverse_permutation(vertices)[others]  # in the vertices of the first mesh
    matches, turns = np.divmod(matching_corners(faces, renumbered, n_verts), 3)
    corners = 3 * matches[:, np.newaxis] + (turns[:, np.newaxis] + np.arange(3)) % 3
    n_distinct = len(np.unique(lowest_rotation(faces, n_verts)[0], axis=0))
    if n_distinct < len(faces) or not np.array_equal(renumbered.ravel()[corners], faces):
        return None
    return corners.ravel()


def _joined(run: Sequence[FrameSource]) -> FrameSource:
    """Return the frames of segments with the same mesh."""
    if len(run) == 1:
        return run[0]
    loaded = [frames_of(part, range(part.n_frames)) for part in run]
    return loaded[0].replace(
        vertices=hand_over(np.concatenate([part.vertices for part in loaded])),
        tracks=concatenate_tracks([part.tracks for part in loaded]),
        error_bound=error_bound_of(*loaded),
    )
