"""Completion of keys: they get the surface that other frames show beyond their boundary."""

from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from meshreel.arrays import Floats
from meshreel.metrics.closest_points import k_d_tree
from meshreel.model.geometry.connectivity import component_labels
from meshreel.model.sequence import Faces
from meshreel.registration.decimating import decimated_key
from meshreel.registration.refining import KeyMesh
from meshreel.registration.triangle_mesh import Indices, TriangleMesh
from meshreel.registration.verification import Tolerance

MIN_AREA = 0.25
"""Smallest area of a patch, as a share of the largest that may be beyond the tolerance."""

MIN_SHARE_BEYOND = 0.5
"""Share of a patch that must be beyond the boundary of the key, not merely far from it."""

MAX_GAP = 3.0
"""Largest distance, in mean edges of the frame, between the border of a patch and the boundary that
it joins."""

MIN_COSINE = 0.5
"""Smallest cosine between the normals of both."""

MAX_SLIT = 12.0
"""Longest outline, in mean edges of the frame, of a slit between patch and key that is closed."""

N_ANCHORS = 16
"""Boundary vertices of the key with which a vertex of a patch moves."""


class Sighting(NamedTuple):
    """A key that was registered to a frame, which may show more of the surface.

    Attributes
    ----------
    mesh : TriangleMesh
        The registered key.
    turns : float64 array of shape (V, 3, 3)
        The rotation of each vertex from the key.
    target : TriangleMesh
        The surface of the frame.
    """

    mesh: TriangleMesh
    turns: Floats
    target: TriangleMesh


def completed(
    key: KeyMesh, whole: TriangleMesh, sightings: Iterable[Sighting], tolerance: Tolerance
) -> KeyMesh:
    """Return a key with patches of frames that lie beyond its boundary; else the key itself.

    Patches are moved back to the key with the boundary that they join, the largest first.

    Parameters
    ----------
    whole : TriangleMesh
        The cleaned raw mesh of the key, to which the corners of the key refer.
    sightings : iterable of Sighting
        Of this key.
    """
    patches = [(patch, seen) for seen in sightings for patch in _patches(seen, tolerance)]
    for patch, seen in sorted(patches, key=lambda pair: -pair[0].areas.sum()):
        key = _joined(key, whole, patch, seen, tolerance)
    return key


def _patches(seen: Sighting, tolerance: Tolerance) -> list[TriangleMesh]:
    """Return the connected, decimated patches of a frame beyond the boundary of the key."""
    target = seen.target
    found = seen.mesh.closest(target.centroids)
    far = np.flatnonzero(found.distances > tolerance.length)
    is_beyond = seen.mesh.ends_before(target.centroids[far], found.at(far))
    labels = component_labels(target.faces[far], len(target.vertices))[target.faces[far, 0]]
    _, numbers = np.unique(labels, return_inverse=True)
    areas = np.bincount(numbers, target.areas[far])
    beyond = np.bincount(numbers, target.areas[far] * is_beyond)
    patches = []
    for patch in np.flatnonzero(
        (areas > MIN_AREA * tolerance.patch_area) & (beyond > MIN_SHARE_BEYOND * areas)
    ):
        vertices, faces = _used(target.vertices, target.faces[far[numbers == patch]])
        given = KeyMesh.of_mesh(TriangleMesh(vertices, faces))
        patches.append(decimated_key(given, faces.astype(np.int64), tolerance).mesh)
    return patches


def _joined(
    key: KeyMesh, whole: TriangleMesh, patch: TriangleMesh, seen: Sighting, tolerance: Tolerance
) -> KeyMesh:
    """Return the key with a patch whose border is merged with its boundary.

    The key itself, if the patch is not at the boundary, or not beyond it any more.
    """
    own, edge = key.mesh, _mean_edge(seen.target)
    rim = np.flatnonzero(own.is_boundary[: len(seen.mesh.vertices)])
    if not len(rim):
        return key
    _, nearest = k_d_tree(seen.mesh.oriented[rim]).query(patch.oriented)
    nearest = rim[nearest]
    gaps = np.linalg.norm(patch.vertices - seen.mesh.vertices[nearest], axis=1)
    cosines = np.einsum("nc,nc->n", patch.vertex_normals, seen.mesh.vertex_normals[nearest])
    is_merged = patch.is_boundary & (gaps < MAX_GAP * edge) & (cosines > MIN_COSINE)
    if not is_merged.any():
        return key
    moved = _moved_back(patch.vertices, own.vertices, np.unique(nearest[is_merged]), seen)
    centroids = TriangleMesh(moved, patch.faces).centroids
    found = own.closest(centroids)
    is_new = (found.distances > tolerance.length) & own.ends_before(centroids, found)
    if patch.areas @ is_new < MIN_SHARE_BEYOND * patch.areas.sum():
        return key
    numbers = np.where(is_merged, nearest, len(own.vertices) + np.arange(len(moved)))
    added = _consistent(own.faces, numbers[patch.faces].astype(np.int32))
    vertices = np.concatenate([own.vertices, moved])
    added = np.concatenate([added, _slits(vertices, own.faces, added, MAX_SLIT * edge)])
    places = whole.closest(vertices[added].mean(axis=1))
    weights = np.eye(3)[places.weights.argmax(axis=1)]
    return KeyMesh(
        TriangleMesh(*_used(vertices, np.concatenate([own.faces, added]))),
        np.concatenate([key.parents, np.repeat(places.faces[:, None], 3, axis=1)]),
        np.concatenate([key.weights, np.repeat(weights[:, None], 3, axis=1)]),
        key.n_added + len(added),
    )


def _used(vertices: Floats, faces: Faces) -> tuple[Floats, Faces]:
    """Return the vertices that faces use, and the faces with their new numbers."""
    used, corners = np.unique(faces, return_inverse=True)
    return vertices[used], corners.reshape(-1, 3).astype(np.int32)


def _mean_edge(mesh: TriangleMesh) -> float:
    corners = mesh.vertices[mesh.faces]
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean())


def _moved_back(points: Floats, rest: Floats, anchors: Indices, seen: Sighting) -> Floats:
    """Return points of a frame in the pose of the key, as anchors near them move.

    Parameters
    ----------
    rest : float64 array of shape (V, 3)
        The vertices of the key.
    anchors : int64 array of shape (A,)
        Numbers of vertices of the key.
    """
    places = seen.mesh.vertices[anchors]
    distances, near = k_d_tree(places).query(points, np.arange(1, 1 + min(N_ANCHORS, len(anchors))))
    weights = 1.0 / np.maximum(distances, 1e-100) ** 2  # the nearest alone, where it is there
    weights /= weights.sum(axis=1, keepdims=True)
    arms = points[:, None] - places[near]
    moved = rest[anchors][near] + np.einsum("nkji,nkj->nki", seen.turns[anchors][near], arms)
    return np.asarray(np.einsum("nk,nki->ni", weights, moved))


def _consistent(faces: Faces, added: Faces) -> Faces:
    """Return the added faces with which each side belongs to one face in its direction."""
    first, second, third = added.T
    added = added[(first != second) & (second != third) & (third != first)]
    while True:
        _, numbers, counts = np.unique(
            _sides(np.concatenate([faces, added])), axis=0, return_inverse=True, return_counts=True
        )
        of_added = counts[numbers.ravel()].reshape(-1, 3)[len(faces) :]
        is_shared = (of_added > 1).any(axis=1)
        if not is_shared.any():
            return added
        added = added[~is_shared]


def _sides(faces: Faces) -> Indices:
    """Return the ends of the sides of all faces, of shape (3 M, 2)."""
    return np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2).astype(np.int64)


def _slits(vertices: Floats, faces: Faces, added: Faces, max_length: float) -> Faces:
    """Return faces that close short loops of open sides, some of which are of added faces."""
    own, new = (set(map(tuple, _sides(some).tolist())) for some in (faces, added))
    sides, closed = own | new, list[list[int]]()
    for loop in _loops([side for side in sides if side[::-1] not in sides]):
        around = [*loop, loop[0]]
        length = np.linalg.norm(np.diff(vertices[around], axis=0), axis=1).sum()
        if length < max_length and any(side in new for side in pairwise(around)):
            closed += _triangulated(vertices, loop[::-1])
    return np.array(closed, np.int32).reshape(-1, 3)


def _loops(sides: Iterable[tuple[int, int]]) -> Iterator[list[int]]:
    """Yield the vertices of the loops of sides; loops that touch are apart."""
    following: dict[int, list[int]] = {}
    for start, end in sorted(sides):
        following.setdefault(start, []).append(end)
    for first in following:
        path = [first]
        while following.get(path[-1]):
            end = following[path[-1]].pop()
            if end in path:
                at = path.index(end)
                yield path[at:]
                del path[at + 1 :]
            else:
                path.append(end)


def _triangulated(vertices: Floats, loop: list[int]) -> list[list[int]]:
    """Return triangles in a loop: those of the shortest diagonals are cut off first."""
    faces = []
    while len(loop) > 3:
        points = vertices[loop]
        diagonals = np.roll(points, 1, axis=0) - np.roll(points, -1, axis=0)
        ear = int(np.linalg.norm(diagonals, axis=1).argmin())
        faces.append([loop[ear - 1], loop[ear], loop[(ear + 1) % len(loop)]])
        del loop[ear]
    return [*faces, loop] if len(loop) == 3 else faces
