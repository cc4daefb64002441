"""Frames whose vertices and faces are in another order than those of the frame before.

Captured performances are often tracked: over many frames the mesh is the same, but a codec like
Draco has compressed each frame alone, reordered its vertices and faces, and dropped faces without
area. Texture coordinates and other attributes, which do not change over time, identify the faces.
Matched frames have exactly the surface of the input frames: added faces have no area, or coincide
with others.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeGuard

import numpy as np
import numpy.typing as npt

from meshreel.model.geometry.hard_edges import shared_edges
from meshreel.model.matching.corners import (
    MISSING_SHARE,
    NONE,
    Corners,
    Integers,
    corners_of,
    distinct_faces,
    is_of_triangles,
    values_at_corners,
)
from meshreel.model.matching.joint_mesh import aligned_faces, joined_vertices
from meshreel.model.sequence import FrameSource, MeshSequence, Vertices
from meshreel.model.surface import Attribute, Domain, FaceGroups, Surface
from meshreel.runtime.progress import Count, Progress, silent


def match_segments(
    segments: Sequence[FrameSource], progress: Progress = silent
) -> list[FrameSource]:
    """Join consecutive segments that have the same mesh, in any order of vertices and faces.

    Segments are matched by all of their attributes and groups; without attributes, by positions,
    if they are at rest. Frames that stay in their files, and meshes with polygons, cells, parts,
    tracks or unused vertices, are not matched.

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
    run: list[Corners] = []
    for number, segment in enumerate(segments, start=1):
        corners = corners_of(segment) if _is_supported(segment) else None
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
    return is_of_triangles(segment.surface) and len(np.unique(segment.faces)) == segment.n_verts


def _joined(run: list[Corners]) -> list[FrameSource]:
    """Join the segments of a run; if they do not match, join each half of the run separately."""
    if len(run) < 2:
        return [member.segment for member in run]
    joined = _join(run)
    if joined is not None:
        return [joined]
    middle = len(run) // 2
    return _joined(run[:middle]) + _joined(run[middle:])


def _join(run: list[Corners]) -> MeshSequence | None:
    """Return the segments of a run as one, or None if their meshes differ."""
    aligned = aligned_faces(run)
    if aligned is None:
        return None
    values, corners = aligned
    is_missing = corners[:, :, 0] == NONE
    if is_missing.mean(axis=1).max() > MISSING_SHARE or is_missing.any(axis=0).all():
        return None
    vertex_of = np.full_like(corners, NONE)  # the vertex of each corner
    for member, numbers, vertices in zip(run, corners, vertex_of, strict=True):
        vertices[numbers != NONE] = member.segment.faces.ravel()[numbers[numbers != NONE]]
    frames = [member.segment.vertices[0] for member in run]
    vertices, faces = joined_vertices(vertex_of.reshape(len(run), -1), values.ravel(), frames)
    positions = [row.segment.vertices[:, order] for row, order in zip(run, vertices, strict=True)]
    for segment_positions, lacks in zip(positions, is_missing, strict=True):
        if not _adds_nothing(segment_positions, faces[lacks], faces[~lacks]):
            return None
    return _assembled(run, positions, vertices, faces, corners)


def _adds_nothing(positions: Vertices, faces: Integers, present: Integers) -> bool:
    """Whether faces do not change the surface of frames (T, V, 3).

    Such a face has two corners at one point, or is at the same points as a present face.
    """
    if not len(faces):
        return True
    near = present[np.isin(present, faces).any(axis=1)]
    for frame in positions:
        _, point_of = np.unique(frame[np.append(faces, near)], axis=0, return_inverse=True)
        points = np.sort(point_of.reshape(-1, 3), axis=1)
        has_area = (points[:, 0] != points[:, 1]) & (points[:, 1] != points[:, 2])
        groups = distinct_faces(points)[1]
        added, existing = np.split(groups, [len(faces)])
        if not np.isin(added[has_area[: len(faces)]], existing).all():
            return False
    return True


def _assembled(
    run: list[Corners],
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
    segments = [member.segment for member in run]
    source = np.argmax(corners[:, :, 0] != NONE, axis=0)  # the first segment with each face
    numbers = corners[source, np.arange(len(faces))]
    order = np.lexsort((numbers[:, 0] // 3, source))
    turns = (np.argmin(numbers % 3, axis=1)[:, None] + np.arange(3)) % 3
    faces, numbers = (np.take_along_axis(table, turns, axis=1)[order] for table in (faces, numbers))
    source = source[order]
    verts, first_corners, inverse = np.unique(faces, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first_corners))
    faces, verts = rank[inverse].reshape(-1, 3), verts[np.argsort(first_corners)]
    surface = _surface(segments, source, numbers, np.sort(first_corners))
    if surface.hard_edges is not None:
        edges = _hard_edges(segments, vertices[:, verts], faces)
        if edges is None:
            return None
        surface = replace(surface, hard_edges=edges)
    return segments[0].replace(
        vertices=np.concatenate([position[:, verts] for position in positions]),
        faces=faces.astype(np.int32),
        surface=surface,
    )


def _surface(
    segments: Sequence[MeshSequence], source: Integers, corners: Integers, first_corners: Integers
) -> Surface:
    """Return the surface of joined faces; hard edges are those of the first segment.

    Parameters
    ----------
    source, corners : arrays of shapes (M,) and (M, 3)
        The segment that provides each face, and the corners of the face in it.
    first_corners : array of shape (V,)
        A corner of the joined faces at each vertex.
    """

    def gathered(number: int) -> Attribute:
        first = segments[0].surface.attributes[number]
        values = np.empty((3 * len(source), first.values.shape[1]), first.values.dtype)
        for index in np.unique(source).tolist():
            is_selected = np.repeat(source == index, 3)
            other = segments[index]
            of_corners = values_at_corners(other.surface.attributes[number], other.faces)
            values[is_selected] = of_corners[corners[source == index].ravel()]
        if first.domain is Domain.CORNER and first.indices is None:
            return replace(first, values=values)
        if first.domain is not Domain.CORNER:
            values = values[first_corners if first.domain is Domain.VERTEX else slice(0, None, 3)]
        if first.indices is None:
            return replace(first, values=values)
        return first.indexed(values)

    def regrouped(number: int) -> FaceGroups:
        groups = [segment.surface.groups[number] for segment in segments]
        numbers = np.empty(len(source), np.int32)
        for index in np.unique(source).tolist():
            numbers[source == index] = groups[index].numbers[corners[source == index, 0] // 3]
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
    for number, (segment, vertex_of) in enumerate(zip(segments, vertices, strict=True)):
        ends_in_segment = np.sort(vertex_of[edges], axis=1)
        codes, hard = (
            ends[:, 0] * np.int64(segment.n_verts) + ends[:, 1]
            for ends in (ends_in_segment, np.asarray(segment.surface.hard_edges, np.int64))
        )
        is_hard_edge, has_length = np.isin(codes, hard), np.diff(ends_in_segment)[:, 0] != 0
        if not number:
            is_hard = is_hard_edge
        elif ((is_hard != is_hard_edge) & has_length).any():
            return None
    return edges[is_hard].astype(np.int32)
