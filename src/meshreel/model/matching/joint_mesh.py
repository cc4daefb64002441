"""The mesh that several segments share: faces with the same values at corners, then vertices."""

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from meshreel.model.matching.corners import NONE, Corners, Integers, distinct_faces, joint_numbers
from meshreel.model.sequence import Vertices

AMBIGUOUS_SHARE, MAX_ALIKE = 0.05, 64
"""Maximum share of faces with the same values as another face, and maximum number of such faces."""


def aligned_faces(run: list[Corners]) -> tuple[Integers, Integers] | None:
    """Return the faces of all segments, and their corners in each; None if too many are alike.

    Faces are the same if the values at their corners are. Faces of a segment with equal values are
    distinguished by the values opposite to their sides, then by their positions.

    Returns
    -------
    values : array of shape (M, 3)
        Number of the value at each corner.
    corners : array of shape (S, M, 3)
        Number of each corner in each segment, or NONE.
    """
    numbers = joint_numbers(run)
    faces = [of_values[member.faces] for member, of_values in zip(run, numbers, strict=True)]
    stacked = np.concatenate(faces)
    first, inverse = distinct_faces(stacked)
    keys = stacked[first]
    rows = np.split(inverse, np.cumsum([len(face) for face in faces])[:-1])
    is_alike = (keys == keys[:, :1]).all(axis=1)  # such a face may begin anywhere
    for groups in rows:
        counts = np.bincount(groups, minlength=len(keys))
        is_alike |= counts > 1
        if counts.max() > MAX_ALIKE:
            return None
    if max(is_alike[groups].mean() for groups in rows) > AMBIGUOUS_SHARE:
        return None
    corners = np.full((len(run), len(keys), 3), NONE, np.int32)
    alike = _AlikeFaces(len(run))
    for number, (member, groups) in enumerate(zip(run, rows, strict=True)):
        corners[number, groups] = member.corners
        alike_faces = np.flatnonzero(is_alike[groups])
        alike.add(
            number,
            member,
            groups[alike_faces],
            alike_faces,
            numbers[number][member.opposite[alike_faces]],
        )
    alike_keys, alike_corners = alike.result()
    values = np.concatenate([keys[~is_alike], keys[alike_keys]])
    return values, np.concatenate([corners[:, ~is_alike], alike_corners], axis=1)


class _AlikeFaces:
    """Faces with the values of others, aligned from segment to segment."""

    def __init__(self, n_segments: int) -> None:
        self._n_segments = n_segments
        self._keys: list[int] = []
        self._corners: list[Integers] = []
        self._last: list[_Descriptor] = []
        self._of_key: dict[int, list[int]] = {}

    def add(
        self, number: int, corners: Corners, keys: Integers, numbers: Integers, opposite: Integers
    ) -> None:
        """Add faces of the next segment.

        Parameters
        ----------
        number : int
            Number of the segment.
        keys : array of shape (N,)
            Number of the values of each face.
        numbers : array of shape (N,)
            Number of each face in the segment.
        opposite : array of shape (N, 3)
            Value opposite to each side.
        """
        vertices = corners.segment.faces.ravel()[corners.corners[numbers]]
        first, last = (corners.segment.vertices[frame][vertices].astype(float) for frame in (0, -1))
        of_key: dict[int, list[int]] = {}
        for index, key in enumerate(keys.tolist()):
            of_key.setdefault(key, []).append(index)
        for key, indices in of_key.items():
            known = self._of_key.setdefault(key, [])
            is_turnable = len(set(corners.faces[numbers[indices[0]]].tolist())) == 1
            assigned = _assigned(
                [self._last[i] for i in known],
                [_Descriptor(first[index], opposite[index]) for index in indices],
                turns=3 if is_turnable else 1,
            )
            for index, (face, turn) in zip(indices, assigned, strict=True):
                if face == NONE:
                    face = len(known)
                    known.append(len(self._keys))
                    self._keys.append(key)
                    self._corners.append(np.full((self._n_segments, 3), NONE, np.int32))
                    self._last.append(_Descriptor(last[index], opposite[index]))
                self._corners[known[face]][number] = np.roll(corners.corners[numbers[index]], -turn)
                self._last[known[face]] = _Descriptor(last[index], opposite[index]).turned(turn)

    def result(self) -> tuple[Integers, Integers]:
        """Return the number of the values of each face, and corners of shape (S, N, 3)."""
        keys = np.array(self._keys, np.int64)
        if not len(keys):
            return keys, np.zeros((self._n_segments, 0, 3), np.int32)
        return keys, np.stack(self._corners, axis=1)


class _Descriptor(NamedTuple):
    """Positions of the corners of a face, of shape (3, 3), and values opposite to its sides."""

    points: npt.NDArray[np.float64]
    opposite: Integers

    def turned(self, turn: int) -> "_Descriptor":
        """The same face, beginning with another corner."""
        return _Descriptor(np.roll(self.points, -turn, axis=0), np.roll(self.opposite, -turn))


def _assigned(
    known: Sequence[_Descriptor], faces: Sequence[_Descriptor], turns: int
) -> list[tuple[int, int]]:
    """Assign faces to known ones: those with equal neighbors first, then the nearest.

    Positions are compared relative to the mean of all these faces.

    Parameters
    ----------
    turns : int
        Number of corners with which a face may begin: 3 if its values are equal, otherwise 1.

    Returns
    -------
    list of (int, int)
        Index of the known face of each face, or NONE, and by how many corners it is rotated.
    """
    assigned = [(NONE, 0)] * len(faces)
    if not known:
        return assigned
    motion = np.mean([face.points for face in faces], axis=(0, 1))
    motion -= np.mean([face.points for face in known], axis=(0, 1))
    pairs = []
    for index, turn in product(range(len(faces)), range(turns)):
        points, opposite = faces[index].turned(turn)
        for number, other in enumerate(known):
            n_differing = int((opposite != other.opposite).sum())
            distance = float(np.square(points - motion - other.points).sum())
            pairs.append((n_differing, distance, index, turn, number))
    assigned_numbers: set[int] = set()
    for _, _, index, turn, number in sorted(pairs):
        if assigned[index][0] == NONE and number not in assigned_numbers:
            assigned[index] = number, turn
            assigned_numbers.add(number)
    return assigned


def joined_vertices(
    corners: Integers, values: Integers, frames: Sequence[Vertices]
) -> tuple[Integers, Integers]:
    """Return the vertices of the joined mesh in each segment, and the joined faces.

    Two corners belong to one vertex if they share a vertex in every segment that has both.

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
    for vertex_of in corners[:, complete]:
        _, number = np.unique(number * (vertex_of.max() + 1) + vertex_of, return_inverse=True)
    _, first, number = np.unique(number, return_index=True, return_inverse=True)
    result = np.full(corners.shape[1], NONE, np.int64)
    result[complete] = number
    vertices = list(corners[:, complete[first]].T)
    vertices_of_value: dict[int, list[int]] = {}
    near = complete[np.isin(values[complete], values[~is_complete])]
    for vertex, corner in zip(*np.unique(result[near], return_index=True), strict=True):
        vertices_of_value.setdefault(int(values[near[corner]]), []).append(int(vertex))
    for corner in np.flatnonzero(~is_complete).tolist():
        vertex = _vertex_of_corner(
            corners[:, corner], vertices, vertices_of_value.setdefault(int(values[corner]), [])
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

    A vertex is placed at a neighbor in such a face, which then has no area; or, if the segment
    lacks the whole component, at the nearest other vertex.

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
    pending = [
        (vertex, int(segment))
        for vertex in faces_at
        for segment in np.flatnonzero(vertices[vertex] == NONE)
    ]
    while pending:
        remaining = []
        for vertex, segment in pending:
            lacking = [face for face in faces_at[vertex] if corners[segment, face, 0] == NONE]
            near = [i for i in faces[lacking].ravel().tolist() if vertices[i][segment] != NONE]
            if near:
                target = max(sorted(set(near)), key=near.count)
                vertices[vertex][segment] = vertices[target][segment]
            else:
                remaining.append((vertex, segment))
        if len(remaining) == len(pending):
            vertex, segment = remaining.pop()
            # Distances are those in a segment that has the vertex.
            other = int(np.argmax(vertices[vertex] != NONE))
            known = frames[other][[vertex_of[other] for vertex_of in vertices[:n_known]]]
            offsets = known - frames[other][vertices[vertex][other]]
            target = int(np.argmin(np.square(offsets, dtype=np.float64).sum(axis=1)))
            vertices[vertex][segment] = vertices[target][segment]
        pending = remaining


def _vertex_of_corner(corner: Integers, vertices: list[Integers], candidates: list[int]) -> int:
    """Return the candidate with the vertices of a corner, or a new vertex.

    Parameters
    ----------
    corner : array of shape (S,)
        Vertex of the corner in each segment, or NONE.
    vertices : list of such arrays
        Those of all joined vertices; a new one is appended.
    candidates : list of int
        Joined vertices with the value of the corner.
    """
    for vertex in candidates:
        joined = vertices[vertex]
        is_known = (corner != NONE) & (joined != NONE)
        if is_known.any() and (corner == joined)[is_known].all():
            vertices[vertex] = np.where(joined == NONE, corner, joined)
            return vertex
    candidates.append(len(vertices))
    vertices.append(corner.copy())
    return candidates[-1]
