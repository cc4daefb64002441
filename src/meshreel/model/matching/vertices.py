"""Vertices of a mesh that several segments share, from its corners in each of them."""

from collections.abc import Sequence

import numpy as np

from meshreel.model.matching.corners import NONE, Integers
from meshreel.model.sequence import Vertices


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
            target = _nearest_known(vertex, vertices, n_known, frames)
            vertices[vertex][segment] = vertices[target][segment]
        pending = remaining


def _nearest_known(
    vertex: int, vertices: Sequence[Integers], n_known: int, frames: Sequence[Vertices]
) -> int:
    """Return the vertex below `n_known` that is nearest in a segment where a vertex is known."""
    segment = int(np.argmax(vertices[vertex] != NONE))
    positions = frames[segment]
    known = positions[[vertex_of[segment] for vertex_of in vertices[:n_known]]]
    offsets = np.square(known - positions[vertices[vertex][segment]], dtype=np.float64)
    return int(np.argmin(offsets.sum(axis=1)))


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
