"""Segments that continue the mesh of the segment before them in another order."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers, rows_as_bytes
from meshreel.codec.connectivity.triangles import rotate_corners
from meshreel.model.sequence import (
    Faces,
    FrameSource,
    MeshSequence,
    Vertices,
    frames_of,
)
from meshreel.model.surface import Attribute, Domain, Surface
from meshreel.model.tracks import Track, TrackSource

Labels = npt.NDArray[np.uint64]


@dataclass(frozen=True, eq=False)
class _Match:
    """Numbers in a mesh of the vertices, faces and corners of another one."""

    vertices: Integers
    faces: Integers
    corners: Integers

    def of(self, domain: Domain) -> Integers:
        """The numbers of the items of a domain."""
        return {
            Domain.VERTEX: self.vertices,
            Domain.FACE: self.faces,
            Domain.CORNER: self.corners,
        }[domain]


def without_reordering(sequence: MeshSequence, order: str | None) -> MeshSequence:
    """Return the sequence with segments joined whose meshes differ only in their order.

    Only if no order is kept. The faces must prove which vertex is which, with the help of
    attributes and of positions that did not change: a symmetric mesh without attributes is not
    matched. Attributes, groups and the kinds of tracks must be equal.

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
    return MeshSequence.of_segments(joined, sequence.name, sequence.start_s)


def joined_note(given: MeshSequence, joined: MeshSequence) -> str:
    """Return a note on segments that `without_reordering` joined; empty if it joined none."""
    counts = [len(one.segments) for one in (given, joined)]
    if counts[0] == counts[1]:
        return ""
    return (
        f"joined {counts[0]} segments to {counts[1]}, as only the order of their vertices and "
        "faces differs, which is not kept"
    )


def _match(first: FrameSource, second: FrameSource) -> _Match | None:
    """Return the numbers in the second mesh of the items of the first; None if not proven."""
    if (first.n_verts, len(first.faces)) != (second.n_verts, len(second.faces)):
        return None
    surfaces = first.surface, second.surface
    kinds = _kinds(first.tracks)
    if not all(map(_is_simple, surfaces)) or kinds is None or kinds != _kinds(second.tracks):
        return None
    if np.array_equal(first.faces, second.faces):
        return None  # segments that a caller chose, such as shots
    labels = _labels_of_data(first, second)
    numbers = None if labels is None else _refined(first.faces, second.faces, *labels)
    found = None if numbers is None else _items(first.faces, second.faces, numbers)
    return found if found is not None and _is_same_surface(*surfaces, found) else None


def _is_simple(surface: Surface) -> bool:
    """Whether a surface has no polygons, hard edges and parts, which streams without order omit."""
    return surface.face_sizes is None and surface.hard_edges is None and not surface.parts


def _kinds(tracks: Mapping[str, TrackSource]) -> dict[str, tuple[object, ...]] | None:
    """Return what tracks must have in common to be joined; None if one is not of vertices."""
    kinds: dict[str, tuple[object, ...]] = {}
    for name, one in tracks.items():
        if one.domain is not Domain.VERTEX:
            return None
        kinds[name] = one.kind, one.unit, one.dtype, one.shape[2]
    return kinds


def _labels_of_data(first: FrameSource, second: FrameSource) -> tuple[Labels, Labels] | None:
    """Return labels of vertices, equal where all their values are; None if values differ."""
    labels = np.zeros(first.n_verts, np.uint64), np.zeros(first.n_verts, np.uint64)
    pairs = list(_paired(first.surface, second.surface))
    if len(pairs) != len(first.surface.attributes) or len(pairs) != len(second.surface.attributes):
        return None
    for one, other in pairs:
        if one.domain is Domain.FACE:
            continue
        numbers = _row_numbers(one.per_item(), other.per_item())
        for label, faces, of_items in zip(
            labels, (first.faces, second.faces), numbers, strict=True
        ):
            vertices = np.arange(len(label)) if one.domain is Domain.VERTEX else faces.ravel()
            np.add.at(label, vertices, _mixed(of_items))
            label[:] = _mixed(label)
    last, next_one = first.read(first.n_frames - 1, first.n_frames)[0], second.read(0, 1)[0]
    rows = _row_numbers(last, next_one)
    if np.array_equal(np.sort(rows[0]), np.sort(rows[1])):  # the mesh rests
        for label, of_vertices in zip(labels, rows, strict=True):
            label += _mixed(of_vertices)
    return labels


def _row_numbers(first: Vertices, second: Vertices) -> tuple[Labels, Labels]:
    """Return numbers of the rows of two arrays; equal rows have equal numbers."""
    if first.dtype != second.dtype or first.shape != second.shape:
        return np.zeros(len(first), np.uint64), np.ones(len(second), np.uint64)
    _, numbers = np.unique(rows_as_bytes(np.concatenate([first, second])), return_inverse=True)
    split = np.split(numbers.astype(np.uint64), 2)
    return split[0], split[1]


def _refined(faces: Faces, others: Faces, labels: Labels, labels_hat: Labels) -> Integers | None:
    """Return the vertex of the second mesh of each vertex of the first; None if ambiguous.

    Labels of vertices are refined by those of their neighbors in order around each face, until
    each vertex has its own label, or no refinement is left (color refinement).
    """
    n_distinct = 0
    while np.array_equal(np.sort(labels), np.sort(labels_hat)):
        distinct = len(np.unique(labels))
        if distinct == len(labels):
            numbers = np.empty(len(labels), np.int64)
            numbers[np.argsort(labels)] = np.argsort(labels_hat)
            return numbers
        if distinct <= n_distinct:
            return None
        n_distinct = distinct
        labels, labels_hat = _around(faces, labels), _around(others, labels_hat)
    return None


def _around(faces: Faces, labels: Labels) -> Labels:
    """Return labels that depend on those of the next two corners of each face of a vertex."""
    sums = np.zeros_like(labels)
    for corner in range(3):
        following = labels[faces[:, (corner + 1) % 3]], labels[faces[:, (corner + 2) % 3]]
        np.add.at(sums, faces[:, corner], _mixed(following[0] + _mixed(following[1])))
    return _mixed(labels + _mixed(sums))


def _mixed(values: Labels) -> Labels:
    """Return well-mixed bits of numbers, as the finalizer of SplitMix64."""
    mixed = values + np.uint64(0x9E3779B97F4A7C15)
    mixed = (mixed ^ (mixed >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return mixed ^ (mixed >> np.uint64(31))


def _items(faces: Faces, others: Faces, vertices: Integers) -> _Match | None:
    """Return the match of faces and corners, given that of vertices; None if faces differ."""
    given = np.empty_like(vertices)
    given[vertices] = np.arange(len(vertices))
    rows, turns = _turned(faces.astype(np.int64))
    rows_hat, turns_hat = _turned(given[others])
    order, order_hat = np.lexsort(rows.T), np.lexsort(rows_hat.T)
    is_repeated = (np.diff(rows[order], axis=0) == 0).all(axis=1).any()
    if is_repeated or not np.array_equal(rows[order], rows_hat[order_hat]):
        return None
    of_faces = np.empty(len(faces), np.int64)
    of_faces[order] = order_hat
    turned = np.arange(3) - turns[:, np.newaxis] + turns_hat[of_faces][:, np.newaxis]
    return _Match(vertices, of_faces, (3 * of_faces[:, np.newaxis] + turned % 3).ravel())


def _turned(faces: Integers) -> tuple[Integers, Integers]:
    """Return faces that begin with their lowest vertex, and the corner that it was."""
    turns = faces.argmin(axis=1)
    return rotate_corners(faces, turns), turns


def _paired(first: Surface, second: Surface) -> Iterator[tuple[Attribute, Attribute]]:
    """Yield the attributes of two surfaces that have name, kind and domain in common."""
    for one, other in zip(first.attributes, second.attributes, strict=False):
        if (one.name, one.kind, one.domain) == (other.name, other.kind, other.domain):
            yield one, other


def _is_same_surface(first: Surface, second: Surface, match: _Match) -> bool:
    """Whether attributes, groups and materials of two meshes are equal after matching."""
    for one, other in _paired(first, second):
        values, values_hat = one.per_item(), other.per_item()[match.of(one.domain)]
        if values.dtype != values_hat.dtype or values.tobytes() != values_hat.tobytes():
            return False
    groups = [(one.name, one.labels, one.numbers.tobytes()) for one in first.groups]
    groups_hat = [
        (one.name, one.labels, one.numbers[match.faces].tobytes()) for one in second.groups
    ]
    images = [[one.data for one in surface.images] for surface in (first, second)]
    n_attributes = len(first.attributes), len(second.attributes)
    return (
        groups == groups_hat
        and first.materials == second.materials
        and images[0] == images[1]
        and n_attributes[0] == n_attributes[1] == len(list(_paired(first, second)))
    )


def _appended(first: FrameSource, second: FrameSource, match: _Match) -> MeshSequence:
    """Return the frames of both, in the order of the first."""
    one, other = (frames_of(each, range(each.n_frames)) for each in (first, second))
    tracks = {
        name: Track(
            np.concatenate([track.values, other.tracks[name].values[:, match.vertices]]),
            track.domain,
            track.kind,
            track.unit,
        )
        for name, track in one.tracks.items()
    }
    vertices = np.concatenate([one.vertices, other.vertices[:, match.vertices]])
    return one.replace(vertices=vertices, tracks=tracks)
