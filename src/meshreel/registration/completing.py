"""Completion of keys: add the surface that other frames show beyond their boundary."""

from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.metrics.closest_points import k_d_tree
from meshreel.model.geometry.connectivity import face_components
from meshreel.model.sequence import Faces
from meshreel.registration.cleaning import compact
from meshreel.registration.decimating import decimated_key
from meshreel.registration.refining import KeyMesh
from meshreel.registration.triangle_mesh import Indices, TriangleMesh
from meshreel.registration.verification import Tolerance

MIN_AREA = 0.25
"""Minimum area of a patch, as a share of the largest area that may be beyond the tolerance."""

MIN_SHARE_BEYOND = 0.5
"""Share of a patch that must be beyond the boundary of the key, not merely far from it."""

MAX_GAP = 3.0
"""Largest distance from the border of a patch to the boundary that it joins, in mean edges of the
frame."""

MIN_COSINE = 0.5
"""Minimum cosine between the normals of the border and of the boundary."""

MAX_SLIT = 12.0
"""Longest outline, in mean edges of the frame, of a slit between patch and key that is closed."""

N_ANCHORS = 16
"""Boundary vertices of the key with which a vertex of a patch moves."""


class RegisteredKey(NamedTuple):
    """A key registered to a frame that may show more of the surface.

    Attributes
    ----------
    mesh : TriangleMesh
        The registered key.
    rotations : float64 array of shape (V, 3, 3)
        Rotation of each vertex from the key to the frame.
    target : TriangleMesh
        The surface of the frame.
    """

    mesh: TriangleMesh
    rotations: Floats
    target: TriangleMesh

    def patches(self, rest: Floats, tolerance: Tolerance) -> Iterator[TriangleMesh]:
        """Yield the patches of the frame beyond the boundary of the key, in the pose of the key.

        They move with the boundary that they join.

        Parameters
        ----------
        rest : float64 array of shape (V, 3)
            The vertices of the key.
        """
        for patch in _patches_beyond(self.mesh, self.target, tolerance):
            nearest, is_near = _match_boundary(self.mesh, patch, _mean_edge(self.target))
            if is_near.any():
                vertices = _move_to_key(patch.vertices, rest, np.unique(nearest[is_near]), self)
                yield TriangleMesh(vertices, patch.faces)


def may_lack_surface(mesh: TriangleMesh, tolerance: Tolerance) -> bool:
    """Return whether a key has a hole that is large enough for a patch.

    The outline of a sheet is no hole: a flat surface of area A has an outline of at least
    sqrt(4 pi A) (the isoperimetric inequality), a body with a hole a shorter one.
    """
    lengths, areas = mesh.boundaries
    is_hole = lengths**2 < 4 * np.pi * areas
    return bool((lengths[is_hole] ** 2 > 4 * np.pi * MIN_AREA * tolerance.patch_area).any())


def complete_key(
    key: KeyMesh, cleaned: TriangleMesh, patches: Iterable[TriangleMesh], tolerance: Tolerance
) -> KeyMesh:
    """Return a key extended by patches beyond its boundary, the largest first; or the key itself.

    Parameters
    ----------
    cleaned : TriangleMesh
        The cleaned raw mesh of the key, to which the corners of the key refer.
    patches : iterable of TriangleMesh
        In the pose of the key.
    """
    for patch in sorted(patches, key=lambda patch: -patch.areas.sum()):
        edge = _mean_edge(patch)
        for part in list(_patches_beyond(key.mesh, patch, tolerance)):
            key = _join(key, cleaned, part, edge, tolerance)
    return key


def _patches_beyond(
    key: TriangleMesh, surface: TriangleMesh, tolerance: Tolerance
) -> Iterator[TriangleMesh]:
    """Yield the connected patches of a surface that are beyond the boundary of the key."""
    closest = key.closest(surface.centroids)
    far = np.flatnonzero(closest.distances > tolerance.length)
    is_beyond = key.ends_before(surface.centroids[far], closest.at(far))
    numbers = face_components(surface.faces[far], len(surface.vertices))
    areas = np.bincount(numbers, surface.areas[far])
    beyond = np.bincount(numbers, surface.areas[far] * is_beyond)
    for patch in np.flatnonzero(
        (areas > MIN_AREA * tolerance.patch_area) & (beyond > MIN_SHARE_BEYOND * areas)
    ):
        yield TriangleMesh(*compact(surface.vertices, surface.faces[far[numbers == patch]]))


def _match_boundary(
    key: TriangleMesh, patch: TriangleMesh, edge: float
) -> tuple[Indices, npt.NDArray[np.bool_]]:
    """Return the nearest boundary vertex for each vertex of a patch, and which ones are near it."""
    boundary = np.flatnonzero(key.is_boundary)
    if not len(boundary):
        return np.zeros(len(patch.vertices), np.int64), np.zeros(len(patch.vertices), bool)
    _, indices = k_d_tree(key.oriented[boundary]).query(patch.oriented)
    nearest = boundary[indices]
    gaps = np.linalg.norm(patch.vertices - key.vertices[nearest], axis=1)
    cosines = np.einsum("nc,nc->n", patch.vertex_normals, key.vertex_normals[nearest])
    return nearest, patch.is_boundary & (gaps < MAX_GAP * edge) & (cosines > MIN_COSINE)


def _join(
    key: KeyMesh, cleaned: TriangleMesh, patch: TriangleMesh, edge: float, tolerance: Tolerance
) -> KeyMesh:
    """Return the key joined with a decimated patch along its boundary, if possible."""
    patch_key = KeyMesh.of_mesh(patch)
    patch = decimated_key(patch_key, patch.faces.astype(np.int64), tolerance).mesh
    mesh = key.mesh
    nearest, is_merged = _match_boundary(mesh, patch, edge)
    if not is_merged.any():
        return key
    numbers = np.where(is_merged, nearest, len(mesh.vertices) + np.arange(len(patch.vertices)))
    added = _without_conflicts(mesh.faces, numbers[patch.faces].astype(np.int32))
    if not len(added):
        return key
    vertices = np.concatenate([mesh.vertices, patch.vertices])
    added = np.concatenate([added, _close_slits(vertices, mesh.faces, added, MAX_SLIT * edge)])
    closest = cleaned.closest(vertices[added].mean(axis=1))
    weights = np.eye(3)[closest.weights.argmax(axis=1)]
    return KeyMesh(
        TriangleMesh(*compact(vertices, np.concatenate([mesh.faces, added]))),
        np.concatenate([key.parents, np.repeat(closest.faces[:, None], 3, axis=1)]),
        np.concatenate([key.weights, np.repeat(weights[:, None], 3, axis=1)]),
        key.n_added + len(added),
    )


def _mean_edge(mesh: TriangleMesh) -> float:
    corners = mesh.vertices[mesh.faces]
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean())


def _move_to_key(
    points: Floats, rest: Floats, anchors: Indices, registered: RegisteredKey
) -> Floats:
    """Return points of a frame, moved to the pose of the key with the anchors near them.

    Parameters
    ----------
    rest : float64 array of shape (V, 3)
        The vertices of the key.
    anchors : int64 array of shape (A,)
        Numbers of vertices of the key.
    """
    positions = registered.mesh.vertices[anchors]
    distances, near = k_d_tree(positions).query(
        points, np.arange(1, 1 + min(N_ANCHORS, len(anchors)))
    )
    weights = 1.0 / np.maximum(distances, 1e-100) ** 2  # a point at an anchor moves with it alone
    weights /= weights.sum(axis=1, keepdims=True)
    offsets = points[:, None] - positions[near]
    moved = rest[anchors][near] + np.einsum(
        "nkji,nkj->nki", registered.rotations[anchors][near], offsets
    )
    return np.asarray(np.einsum("nk,nki->ni", weights, moved))


def _without_conflicts(faces: Faces, added: Faces) -> Faces:
    """Return the added faces that keep the surface oriented: no two faces share a half-edge."""
    first, second, third = added.T
    added = added[(first != second) & (second != third) & (third != first)]
    while True:
        _, numbers, counts = np.unique(
            _half_edges(np.concatenate([faces, added])),
            axis=0,
            return_inverse=True,
            return_counts=True,
        )
        n_uses = counts[numbers.ravel()].reshape(-1, 3)[len(faces) :]
        is_shared = (n_uses > 1).any(axis=1)
        if not is_shared.any():
            return added
        added = added[~is_shared]


def _half_edges(faces: Faces) -> Indices:
    """Return the half-edges of all faces as pairs of vertices, of shape (3 M, 2)."""
    return np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2).astype(np.int64)


def _close_slits(vertices: Floats, faces: Faces, added: Faces, max_length: float) -> Faces:
    """Return faces that close short boundary loops with half-edges of added faces."""
    new_edges = set(map(tuple, _half_edges(added).tolist()))
    half_edges = new_edges.union(map(tuple, _half_edges(faces).tolist()))
    closing: list[list[int]] = []
    for loop in _loops([edge for edge in half_edges if edge[::-1] not in half_edges]):
        path = [*loop, loop[0]]
        length = np.linalg.norm(np.diff(vertices[path], axis=0), axis=1).sum()
        if length < max_length and any(edge in new_edges for edge in pairwise(path)):
            closing += _triangulate(vertices, loop[::-1])
    return np.array(closing, np.int32).reshape(-1, 3)


def _loops(half_edges: Iterable[tuple[int, int]]) -> Iterator[list[int]]:
    """Yield the vertices of each loop of half-edges; loops that touch are separate."""
    successors: dict[int, list[int]] = {}
    for start, end in sorted(half_edges):
        successors.setdefault(start, []).append(end)
    for first in successors:
        path = [first]
        while successors.get(path[-1]):
            end = successors[path[-1]].pop()
            if end in path:
                index = path.index(end)
                yield path[index:]
                del path[index + 1 :]
            else:
                path.append(end)


def _triangulate(vertices: Floats, loop: list[int]) -> list[list[int]]:
    """Triangulate a loop by cutting off ears, the one with the shortest diagonal first."""
    faces = []
    while len(loop) > 3:
        points = vertices[loop]
        diagonals = np.roll(points, 1, axis=0) - np.roll(points, -1, axis=0)
        ear = int(np.linalg.norm(diagonals, axis=1).argmin())
        faces.append([loop[ear - 1], loop[ear], loop[(ear + 1) % len(loop)]])
        del loop[ear]
    return [*faces, loop] if len(loop) == 3 else faces
