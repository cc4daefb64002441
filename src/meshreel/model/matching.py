"""Frames whose vertices and faces are in another order than those of the frame before.

Captured performances are often tracked: over many frames the mesh is the same, but a codec like
Draco has compressed each frame alone, reordered its vertices and faces, and left out faces without
area. Texture coordinates and other attributes, which do not change over time, identify the faces.
Matched frames have the surface of the given ones exactly: the faces that are added have no area, or
coincide with others.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, NamedTuple, TypeGuard

import numpy as np
import numpy.typing as npt

from meshreel.kernel.order import opposite_sides
from meshreel.model.geometry.hard_edges import shared_edges
from meshreel.model.sequence import Faces, FrameSource, MeshSequence, Vertices
from meshreel.model.surface import Attribute, Domain, FaceGroups, Surface
from meshreel.runtime.progress import Count, Progress, silent

Integers = npt.NDArray[np.signedinteger[Any]]
Rows = npt.NDArray[np.void]

NONE = -1
"""Vertex of a corner that a frame does not have."""

MISSING_SHARE = 0.02
"""Largest share of faces, and of the values at corners, that a frame may lack."""

AMBIGUOUS_SHARE, MAX_ALIKE = 0.05, 64
"""Largest share of faces that others equal in their values, and largest number of equal faces."""


def match_segments(
    segments: Sequence[FrameSource], progress: Progress = silent
) -> list[FrameSource]:
    """Join consecutive segments that have the same mesh, in any order of vertices and faces.

    Segments are matched by all of their attributes and groups; without attributes, by positions,
    if they are at rest. Frames that stay in their files, and meshes with polygons, parts, tracks or
    unused vertices, are not matched.

    Parameters
    ----------
    segments : sequence of MeshSequence or other FrameSource
        At least one.
    progress : Progress
        Called with the number of segments compared.

    Returns
    -------
    list of FrameSource
        Fewer, longer segments; a segment that matches no other is returned unchanged. The order of
        vertices and faces of a joined segment is that of its first frame, followed by the faces
        that only later frames have.
    """
    result: list[FrameSource] = []
    run: list[_Corners] = []
    for number, segment in enumerate(segments, start=1):
        corners = _corners_of(segment) if _is_supported(segment) else None
        if corners is None or (run and not run[-1].has_faces_of(corners)):
            result += _joined(run)
            run = []
        if corners is None:
            result.append(segment)
        else:
            run.append(corners)
        progress("matching", Count(number, len(segments), "segments"))
    return result + _joined(run)


def _is_supported(segment: FrameSource) -> TypeGuard[MeshSequence]:
    if not isinstance(segment, MeshSequence) or segment.tracks:
        return False
    if segment.surface.face_sizes is not None or segment.surface.parts:
        return False
    return len(np.unique(segment.faces)) == segment.n_verts


def _joined(run: list["_Corners"]) -> list[FrameSource]:
    """Join as many segments of a run as match; those that do not are tried in halves."""
    if len(run) < 2:
        return [one.segment for one in run]
    joined = _join(run)
    if joined is not None:
        return [joined]
    middle = len(run) // 2
    return _joined(run[:middle]) + _joined(run[middle:])


@dataclass(frozen=True)
class _Corners:
    """The corners of a segment's triangles, identified by values that do not change over time.

    Attributes
    ----------
    segment : MeshSequence
    values : array
        Distinct values of all corners as bytes, ascending.
    faces : int32 array of shape (M, 3)
        Integers of the values at the corners of each face, sorted. A face begins with the corner
        that makes its numbers lowest; among equal ones, the numbers opposite to its sides. Faces of
        equal numbers are sorted by those, too.
    opposite : int32 array of shape (M, 3)
        Number of the value opposite to the side after each corner, in the face across it.
    corners : int32 array of shape (M, 3)
        Number of each of these corners in the segment.
    """

    segment: MeshSequence
    values: Rows
    faces: Integers
    opposite: Integers
    corners: Integers

    def has_faces_of(self, other: "_Corners") -> bool:
        """Whether both segments may have the same mesh: most faces have the values of others."""
        one, two = self.segment, other.segment
        if one.dtype != two.dtype or _description(one.surface) != _description(two.surface):
            return False
        numbers = _joint_numbers([self, other])
        faces = [own[corners.faces] for own, corners in zip(numbers, (self, other), strict=True)]
        found = _distinct_faces(np.concatenate(faces))[1]
        counts = [len(np.unique(found[: len(faces[0])])), len(np.unique(found[len(faces[0]) :]))]
        return int(found.max()) < (1.0 + MISSING_SHARE) * min(counts)


def _distinct_faces(faces: Integers) -> tuple[Integers, Integers]:
    """Return the first of each group of equal faces, and the group of each face."""
    n_values = np.int64(faces.max()) + 1
    _, pairs = np.unique(faces[:, 0] * n_values + faces[:, 1], return_inverse=True)
    _, first, groups = np.unique(
        pairs * n_values + faces[:, 2], return_index=True, return_inverse=True
    )
    return first, groups


def _joint_numbers(several: Sequence[_Corners]) -> list[Integers]:
    """Number the values of several segments; return the number of each of their values."""
    if all(np.array_equal(one.values, several[0].values) for one in several[1:]):
        return [np.arange(len(one.values)) for one in several]
    _, numbers = np.unique(np.concatenate([one.values for one in several]), return_inverse=True)
    return np.split(numbers, np.cumsum([len(one.values) for one in several])[:-1])


def _corners_of(segment: MeshSequence) -> _Corners:
    surface = segment.surface
    columns = [_at_corners(one, segment.faces) for one in surface.attributes]
    columns += [np.repeat(one.numbers, 3)[:, None] for one in surface.groups]
    if not surface.attributes:
        columns.append(segment.vertices[0][segment.faces.ravel()])
    found, _, numbers = _distinct(columns)
    rows = numbers.reshape(-1, 3)
    twins = opposite_sides(segment.faces, segment.n_verts).astype(np.int64)
    across = numbers[3 * (twins // 3) + (twins + 2) % 3].reshape(-1, 3)
    # If two corners have the lowest number, the face begins with the one before the other.
    turns = np.argmin(rows * np.int64(len(found)) + np.roll(rows, -1, axis=1), axis=1)
    turns = (turns[:, None] + np.arange(3)) % 3
    corners = 3 * np.arange(len(rows))[:, None] + turns
    faces, opposite = (np.take_along_axis(one, turns, axis=1) for one in (rows, across))
    return _Corners(segment, found, *(one.astype(np.int32) for one in (faces, opposite, corners)))


def _at_corners(attribute: Attribute, faces: Faces) -> npt.NDArray[np.generic]:
    values = attribute.per_item()
    if attribute.domain is Domain.CORNER:
        return values
    return values[faces.ravel()] if attribute.domain is Domain.VERTEX else np.repeat(values, 3, 0)


def _description(surface: Surface) -> tuple[object, ...]:
    """Everything about a surface except values and groups of faces and hard edges."""
    attributes = [
        (one.name, one.kind, one.domain, one.values.dtype, one.values.shape[1])
        for one in surface.attributes
    ]
    groups = [(one.name, one.labels) for one in surface.groups]
    has_hard_edges = surface.hard_edges is not None
    return attributes, groups, surface.materials, surface.images, has_hard_edges


def _distinct(columns: Sequence[npt.NDArray[np.generic]]) -> tuple[Rows, Integers, Integers]:
    """Return the distinct rows of tables as bytes, ascending, where they are, and their numbers."""
    pieces = [np.ascontiguousarray(one).view(np.uint8).reshape(len(one), -1) for one in columns]
    rows = np.ascontiguousarray(np.concatenate(pieces, axis=1))
    whole = rows.view(np.dtype((np.void, rows.shape[1])))[:, 0]
    return np.unique(whole, return_index=True, return_inverse=True)


# ---- joining ----


def _join(run: list[_Corners]) -> MeshSequence | None:
    """Return the segments of a run as one, or None if their meshes differ."""
    aligned = _aligned(run)
    if aligned is None:
        return None
    values, corners = aligned
    if (corners[:, :, 0] == NONE).sum(axis=1).max() > MISSING_SHARE * len(values):
        return None
    at = np.full_like(corners, NONE)  # the vertex of each corner
    for one, own, vertices in zip(run, corners, at, strict=True):
        vertices[own != NONE] = one.segment.faces.ravel()[own[own != NONE]]
    frames = [one.segment.vertices[0] for one in run]
    vertices, faces = _vertices_of_corners(at.reshape(len(run), -1), values.ravel(), frames)
    positions = [one.segment.vertices[:, own] for one, own in zip(run, vertices, strict=True)]
    for several, own in zip(positions, at, strict=True):
        is_missing = own[:, 0] == NONE
        if not _adds_nothing(several, faces[is_missing], faces[~is_missing]):
            return None
    return _assembled(run, positions, vertices, faces, corners)


def _aligned(run: list[_Corners]) -> tuple[Integers, Integers] | None:
    """Return the faces of all segments, and their corners in each; None if too many are alike.

    Faces are the same if the values at their corners are. Faces of a segment with equal values are
    told apart by the values opposite to their sides, then by their places.

    Returns
    -------
    values : array of shape (M, 3)
        Number of the value at each corner.
    corners : array of shape (S, M, 3)
        Number of each corner in each segment, or NONE.
    """
    own_numbers = _joint_numbers(run)
    faces = [own[one.faces] for one, own in zip(run, own_numbers, strict=True)]
    stacked = np.concatenate(faces)
    first, inverse = _distinct_faces(stacked)
    keys = stacked[first]
    rows = np.split(inverse, np.cumsum([len(one) for one in faces])[:-1])
    is_alike = (keys == keys[:, :1]).all(axis=1)  # such a face may begin anywhere
    for own in rows:
        counts = np.bincount(own, minlength=len(keys))
        is_alike |= counts > 1
        if counts.max() > MAX_ALIKE:
            return None
    if max(is_alike[own].mean() for own in rows) > AMBIGUOUS_SHARE:
        return None
    corners = np.full((len(run), len(keys), 3), NONE, np.int32)
    alike = _AlikeFaces(len(run))
    for number, (one, own) in enumerate(zip(run, rows, strict=True)):
        corners[number, own] = one.corners
        chosen = np.flatnonzero(is_alike[own])
        alike.add(number, one, own[chosen], chosen, own_numbers[number][one.opposite[chosen]])
    own_keys, own_corners = alike.result()
    values = np.concatenate([keys[~is_alike], keys[own_keys]])
    return values, np.concatenate([corners[:, ~is_alike], own_corners], axis=1)


class _AlikeFaces:
    """Faces with the values of others, aligned from segment to segment.

    Parameters
    ----------
    n_segments : int
    """

    def __init__(self, n_segments: int) -> None:
        self._n_segments = n_segments
        self._keys: list[int] = []
        self._corners: list[Integers] = []
        self._last: list[_Place] = []
        self._of_key: dict[int, list[int]] = {}

    def add(
        self, number: int, one: _Corners, keys: Integers, chosen: Integers, opposite: Integers
    ) -> None:
        """Add faces of the next segment.

        Parameters
        ----------
        number : int
            Number of the segment.
        keys : array of shape (N,)
            Number of the values of each face.
        chosen : array of shape (N,)
            Number of each face in the segment.
        opposite : array of shape (N, 3)
            Value opposite to each side.
        """
        vertices = one.segment.faces.ravel()[one.corners[chosen]]
        first, last = (one.segment.vertices[frame][vertices].astype(float) for frame in (0, -1))
        of_key: dict[int, list[int]] = {}
        for index, key in enumerate(keys.tolist()):
            of_key.setdefault(key, []).append(index)
        for key, own in of_key.items():
            known = self._of_key.setdefault(key, [])
            is_turnable = len(set(one.faces[chosen[own[0]]].tolist())) == 1
            found = _assigned(
                [self._last[i] for i in known],
                [_Place(first[index], opposite[index]) for index in own],
                turns=3 if is_turnable else 1,
            )
            for index, (face, turn) in zip(own, found, strict=True):
                if face == NONE:
                    face = len(known)
                    known.append(len(self._keys))
                    self._keys.append(key)
                    self._corners.append(np.full((self._n_segments, 3), NONE, np.int32))
                    self._last.append(_Place(last[index], opposite[index]))
                self._corners[known[face]][number] = np.roll(one.corners[chosen[index]], -turn)
                self._last[known[face]] = _Place(last[index], opposite[index]).turned(turn)

    def result(self) -> tuple[Integers, Integers]:
        """Return the number of the values of each face, and corners of shape (S, N, 3)."""
        keys = np.array(self._keys, np.int64)
        if not len(keys):
            return keys, np.zeros((self._n_segments, 0, 3), np.int32)
        return keys, np.stack(self._corners, axis=1)


class _Place(NamedTuple):
    """Positions of the corners of a face, of shape (3, 3), and values opposite to its sides."""

    points: npt.NDArray[np.float64]
    opposite: Integers

    def turned(self, turn: int) -> "_Place":
        """The place of the face that begins with another corner."""
        return _Place(np.roll(self.points, -turn, axis=0), np.roll(self.opposite, -turn))


def _assigned(
    known: Sequence[_Place], faces: Sequence[_Place], turns: int
) -> list[tuple[int, int]]:
    """Assign faces to known ones: those of equal neighbors first, then the nearest.

    Places are compared relative to the mean of all faces that are assigned here.

    Parameters
    ----------
    turns : int
        Number of corners with which a face may begin: 3 if its values are equal, otherwise 1.

    Returns
    -------
    list of (int, int)
        For each face its known one, or NONE, and by how many corners it is turned.
    """
    found = [(NONE, 0)] * len(faces)
    if not known:
        return found
    moved = np.mean([face.points for face in faces], axis=(0, 1))
    moved -= np.mean([face.points for face in known], axis=(0, 1))
    pairs = []
    for index, turn in product(range(len(faces)), range(turns)):
        points, opposite = faces[index].turned(turn)
        for number, other in enumerate(known):
            n_differing = int((opposite != other.opposite).sum())
            distance = float(np.square(points - moved - other.points).sum())
            pairs.append((n_differing, distance, index, turn, number))
    used: set[int] = set()
    for _, _, index, turn, number in sorted(pairs):
        if found[index][0] == NONE and number not in used:
            found[index] = number, turn
            used.add(number)
    return found


def _vertices_of_corners(
    corners: Integers, values: Integers, frames: Sequence[Vertices]
) -> tuple[Integers, Integers]:
    """Return the vertices of the joined mesh in each segment, and the joined faces.

    Corners are at one vertex if they are in every segment that has them.

    Parameters
    ----------
    corners : array of shape (S, 3 M)
        Vertex at each corner in each segment, or NONE.
    values : array of shape (3 M,)
        Number of the value of each corner.
    frames : sequence of arrays of shape (V_s, 3)
        The first frame of each segment.
    """
    is_complete = (corners != NONE).all(axis=0)
    complete = np.flatnonzero(is_complete)
    number = np.zeros(len(complete), np.int64)
    for own in corners[:, complete]:
        _, number = np.unique(number * (own.max() + 1) + own, return_inverse=True)
    _, first, number = np.unique(number, return_index=True, return_inverse=True)
    result = np.full(corners.shape[1], NONE, np.int64)
    result[complete] = number
    vertices = list(corners[:, complete[first]].T)
    at_value: dict[int, list[int]] = {}
    near = complete[np.isin(values[complete], values[~is_complete])]
    for vertex, corner in zip(*np.unique(result[near], return_index=True), strict=True):
        at_value.setdefault(int(values[near[corner]]), []).append(int(vertex))
    for corner in np.flatnonzero(~is_complete).tolist():
        vertex = _vertex_of_corner(
            corners[:, corner], vertices, at_value.setdefault(int(values[corner]), [])
        )
        result[corner] = vertex
    faces = result.reshape(-1, 3)
    _collapse(vertices, len(first), faces, corners.reshape(len(corners), -1, 3), frames)
    return np.array(vertices).T, faces


def _collapse(
    vertices: list[Integers],
    n_known: int,
    faces: Integers,
    corners: Integers,
    frames: Sequence[Vertices],
) -> None:
    """Place new vertices in segments that lack all of their faces.

    They are put at a neighbor in such a face, so that it has no area; those of a component that a
    segment lacks altogether at the nearest other vertex.

    Parameters
    ----------
    vertices : list of arrays of shape (S,)
        Each vertex in each segment, or NONE; completed from number `n_known` on.
    faces : array of shape (M, 3)
    corners : array of shape (S, M, 3)
        Vertex at each corner in each segment, or NONE.
    frames : sequence of arrays of shape (V_s, 3)
        The first frame of each segment.
    """
    faces_at: dict[int, list[int]] = {vertex: [] for vertex in range(n_known, len(vertices))}
    for face in np.flatnonzero((faces >= n_known).any(axis=1)).tolist():
        for vertex in {*faces[face].tolist()} & faces_at.keys():
            faces_at[vertex].append(face)
    open_places = [
        (vertex, int(segment))
        for vertex in faces_at
        for segment in np.flatnonzero(vertices[vertex] == NONE)
    ]
    while open_places:
        remaining = []
        for vertex, segment in open_places:
            lacking = [face for face in faces_at[vertex] if corners[segment, face, 0] == NONE]
            near = [i for i in faces[lacking].ravel().tolist() if vertices[i][segment] != NONE]
            if near:
                target = max(sorted(set(near)), key=near.count)
                vertices[vertex][segment] = vertices[target][segment]
            else:
                remaining.append((vertex, segment))
        if len(remaining) == len(open_places):
            vertex, segment = remaining.pop()
            target = _nearest_known(vertex, vertices, n_known, frames)
            vertices[vertex][segment] = vertices[target][segment]
        open_places = remaining


def _nearest_known(
    vertex: int, vertices: Sequence[Integers], n_known: int, frames: Sequence[Vertices]
) -> int:
    """Return the vertex below `n_known` that is nearest in a segment where a vertex is known."""
    segment = int(np.argmax(vertices[vertex] != NONE))
    positions = frames[segment]
    known = positions[[one[segment] for one in vertices[:n_known]]]
    apart = np.square(known - positions[vertices[vertex][segment]], dtype=np.float64)
    return int(np.argmin(apart.sum(axis=1)))


def _vertex_of_corner(own: Integers, vertices: list[Integers], candidates: list[int]) -> int:
    """Return the candidate with the vertices of a corner, or a new vertex.

    Parameters
    ----------
    own : array of shape (S,)
        Vertex in each segment, or NONE.
    vertices : list of such arrays
        Those of all joined vertices; a new one is appended.
    candidates : list of int
        Joined vertices with the value of the corner.
    """
    for vertex in candidates:
        there = vertices[vertex]
        is_known = (own != NONE) & (there != NONE)
        if is_known.any() and (own == there)[is_known].all():
            vertices[vertex] = np.where(there == NONE, own, there)
            return vertex
    candidates.append(len(vertices))
    vertices.append(own.copy())
    return candidates[-1]


def _adds_nothing(positions: Vertices, faces: Integers, present: Integers) -> bool:
    """Whether faces do not change the surface of frames (T, V, 3).

    Such a face has two corners at one point, or is at the same points as a present face.
    """
    near = present[np.isin(present, faces).any(axis=1)]
    for frame in positions:
        _, point_of = np.unique(frame[np.append(faces, near)], axis=0, return_inverse=True)
        points = np.sort(point_of.reshape(-1, 3), axis=1)
        points, others = points[: len(faces)], points[len(faces) :]
        has_area = (points[:, 0] != points[:, 1]) & (points[:, 1] != points[:, 2])
        n_points = np.int64(point_of.max(initial=0)) + 1
        keys, near_keys = (
            (one[:, 0] * n_points + one[:, 1]) * n_points + one[:, 2] for one in (points, others)
        )
        if not np.isin(keys[has_area], near_keys).all():
            return False
    return True


def _assembled(
    run: list[_Corners],
    positions: Sequence[Vertices],
    vertices: Integers,
    faces: Integers,
    corners: Integers,
) -> MeshSequence | None:
    """Return the joined segment, or None if hard edges differ.

    Parameters
    ----------
    positions : arrays of shape (T_s, V, 3), for each segment
    vertices : array of shape (S, V)
        Each vertex in each segment.
    faces : array of shape (M, 3)
    corners : array of shape (S, M, 3)
        Number of each corner in each segment, or NONE.
    """
    segments = [one.segment for one in run]
    source = np.argmax(corners[:, :, 0] != NONE, axis=0)  # the first segment with each face
    own = corners[source, np.arange(len(faces))]
    order = np.lexsort((own[:, 0] // 3, source))
    turns = (np.argmin(own % 3, axis=1)[:, None] + np.arange(3)) % 3
    faces, own = (np.take_along_axis(one, turns, axis=1)[order] for one in (faces, own))
    source = source[order]
    used, first_corners, numbers = np.unique(faces, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first_corners))
    faces, used = rank[numbers].reshape(-1, 3), used[np.argsort(first_corners)]
    surface = _surface(segments, source, own, np.sort(first_corners))
    if surface.hard_edges is not None:
        edges = _hard_edges(segments, vertices[:, used], faces)
        if edges is None:
            return None
        surface = replace(surface, hard_edges=edges)
    return replace(
        segments[0],
        vertices=np.concatenate([one[:, used] for one in positions]),
        faces=faces.astype(np.int32),
        surface=surface,
    )


def _surface(
    segments: Sequence[MeshSequence], source: Integers, own: Integers, first_corners: Integers
) -> Surface:
    """Return the surface of joined faces; hard edges are those of the first segment.

    Parameters
    ----------
    source, own : arrays of shapes (M,) and (M, 3)
        The segment from which each face is taken, and its corners there.
    first_corners : array of shape (V,)
        A corner of the joined faces at each vertex.
    """

    def gathered(number: int) -> Attribute:
        first = segments[0].surface.attributes[number]
        values = np.empty((3 * len(source), first.values.shape[1]), first.values.dtype)
        for index in np.unique(source).tolist():
            is_own = np.repeat(source == index, 3)
            other = segments[index]
            of_corners = _at_corners(other.surface.attributes[number], other.faces)
            values[is_own] = of_corners[own[source == index].ravel()]
        if first.domain is Domain.CORNER and first.indices is None:
            return replace(first, values=values)
        if first.domain is not Domain.CORNER:
            values = values[first_corners if first.domain is Domain.VERTEX else slice(0, None, 3)]
        if first.indices is None:
            return replace(first, values=values)
        _, rows, numbers = _distinct([values])
        return replace(first, values=values[rows], indices=numbers.astype(np.int32))

    def regrouped(number: int) -> FaceGroups:
        groups = [one.surface.groups[number] for one in segments]
        numbers = np.empty(len(source), np.int32)
        for index in np.unique(source).tolist():
            numbers[source == index] = groups[index].numbers[own[source == index, 0] // 3]
        return replace(groups[0], numbers=numbers)

    surface = segments[0].surface
    return replace(
        surface,
        is_ordered=False,
        attributes=tuple(map(gathered, range(len(surface.attributes)))),
        groups=tuple(map(regrouped, range(len(surface.groups)))),
    )


def _hard_edges(
    segments: Sequence[MeshSequence], vertices: Integers, faces: Integers
) -> npt.NDArray[np.int32] | None:
    """Return the hard edges of joined faces, or None if those of a segment differ.

    Parameters
    ----------
    vertices : array of shape (S, V)
        Each vertex in each segment.
    """
    edges = shared_edges(np.full(len(faces), 3), faces.ravel()).ends
    is_hard = np.zeros(len(edges), bool)
    for number, (one, own) in enumerate(zip(segments, vertices, strict=True)):
        there = np.sort(own[edges], axis=1)
        codes, hard = (
            ends[:, 0] * np.int64(one.n_verts) + ends[:, 1]
            for ends in (there, np.asarray(one.surface.hard_edges, np.int64))
        )
        is_hard_there = np.isin(codes, hard)
        if not number:
            is_hard = is_hard_there
        elif ((is_hard != is_hard_there) & (there[:, 0] != there[:, 1])).any():
            return None
    return edges[is_hard].astype(np.int32)
