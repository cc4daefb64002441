"""Refinement of key meshes where they bend: edges are split, and the surface stays the same."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.model.sequence import Faces
from meshreel.registration.triangle_mesh import Indices, TriangleMesh

MAX_ANGLE = 1.0
"""Angles between faces count up to this many radians, so that edges at creases stay long enough."""


@dataclass(frozen=True, eq=False)
class KeyMesh:
    """The mesh of a key frame, whose corners are points of the cleaned raw mesh.

    Attributes
    ----------
    mesh : TriangleMesh
    parents : int64 array of shape (M, 3)
        The cleaned face that contains each corner.
    weights : float64 array of shape (M, 3, 3)
        Barycentric coordinates of the corners in these faces.
    n_added : int
        Number of faces from other frames, which are last; their corners are at the nearest points.
    """

    mesh: TriangleMesh
    parents: Indices
    weights: Floats
    n_added: int = 0

    @classmethod
    def of_mesh(cls, mesh: TriangleMesh) -> "KeyMesh":
        """Return the mesh itself."""
        n_faces = len(mesh.faces)
        parents = np.repeat(np.arange(n_faces)[:, None], 3, axis=1)
        return cls(mesh, parents, np.tile(np.eye(3), (n_faces, 1, 1)))

    @property
    def added_area(self) -> float:
        """Area of the faces from other frames."""
        return float(self.mesh.areas[len(self.mesh.faces) - self.n_added :].sum())

    @property
    def is_refined(self) -> bool:
        """Whether an edge is split."""
        return bool((self.weights.max(axis=2) < 1).any())

    def refined(self, max_sagitta: float) -> "KeyMesh":
        """Return the mesh with edges split in halves until their sagitta is at most this.

        The corners of each face must be in one cleaned face.

        The sagitta is the height of an arc over an edge, given the angle between its two faces: how
        far the surface is from the edge if the edge slides along it. On boundaries, the largest
        angle at its ends counts.
        """
        key = self
        while (is_split := (sides := _Sides.of_mesh(key.mesh)).sagittas > max_sagitta).any():
            key = _split(key, sides, is_split)
        return key


@dataclass(frozen=True, eq=False)
class _Sides:
    """The edges of a mesh.

    Attributes
    ----------
    mesh : TriangleMesh
    ends : int64 array of shape (E, 2)
    of_faces : int64 array of shape (M, 3)
        The edge at each side; side k of a face joins its corners k and k + 1.
    """

    mesh: TriangleMesh
    ends: Indices
    of_faces: Indices

    @classmethod
    def of_mesh(cls, mesh: TriangleMesh) -> "_Sides":
        starts, ends = mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()
        low, high = np.minimum(starts, ends), np.maximum(starts, ends)
        keys, of_faces = np.unique(
            low.astype(np.int64) * len(mesh.vertices) + high, return_inverse=True
        )
        pairs = np.stack(np.divmod(keys, max(len(mesh.vertices), 1)), axis=1)
        return cls(mesh, pairs, of_faces.reshape(-1, 3).astype(np.int64))

    @cached_property
    def lengths(self) -> Floats:
        """Length of each edge, of shape (E,)."""
        ends = self.mesh.vertices[self.ends]
        return np.asarray(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1))

    @cached_property
    def sagittas(self) -> Floats:
        """Sagitta of each edge, of shape (E,)."""
        cosines = self.mesh.cosines_across(self.mesh.neighbors)
        angles = np.zeros(len(self.ends))
        np.maximum.at(angles, self.of_faces.ravel(), np.arccos(np.clip(cosines, -1.0, 1.0)))
        at_vertices = np.zeros(len(self.mesh.vertices))
        np.maximum.at(at_vertices, self.ends, angles[:, None])
        is_boundary = np.bincount(self.of_faces.ravel()) == 1
        angles[is_boundary] = at_vertices[self.ends[is_boundary]].max(axis=1)
        return np.minimum(angles, MAX_ANGLE) * self.lengths / 8


def subdivided(mesh: TriangleMesh, max_length: float) -> TriangleMesh:
    """Return the mesh with edges split in halves until none is longer than this."""
    if max_length in mesh.subdivisions:
        return mesh.subdivisions[max_length]
    rest, finished = mesh, list[Faces]()
    while True:  # faces that have no long edge are finished: all faces at an edge are split
        corners = rest.vertices[rest.faces]
        squares = np.square(corners - np.roll(corners, 1, axis=1)).sum(axis=2)
        is_long = (squares > max_length**2).any(axis=1)
        if not is_long.any():
            break
        finished.append(rest.faces[~is_long])
        long = KeyMesh.of_mesh(TriangleMesh(rest.vertices, rest.faces[is_long]))
        sides = _Sides.of_mesh(long.mesh)
        rest = _split(long, sides, sides.lengths >= max_length).mesh
    if not finished:
        return mesh
    fine = TriangleMesh(rest.vertices, np.concatenate([*finished, rest.faces]))
    mesh.subdivisions[max_length] = fine
    return fine


WHOLE = [[0, 1, 2]]
ONE_SIDE = [[0, 3, 2], [3, 1, 2]]
TWO_SIDES = [[3, 1, 4], [0, 3, 4], [0, 4, 2]]
TWO_SIDES_FLIPPED = [[3, 1, 4], [0, 3, 2], [3, 4, 2]]
THREE_SIDES = [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]]
"""Parts of a face with split sides: corners are 0 to 2, and 3 + k is the middle of side k. Sides 0,
or 0 and 1, or all are split; the part beyond two sides has one diagonal or the other."""


def _split(key: KeyMesh, sides: _Sides, is_split: npt.NDArray[np.bool_]) -> KeyMesh:
    """Split edges in halves, and their faces accordingly."""
    vertices, faces = key.mesh.vertices, key.mesh.faces
    middles = np.full(len(sides.ends), -1)
    middles[is_split] = len(vertices) + np.arange(is_split.sum())
    vertices = np.concatenate([vertices, vertices[sides.ends[is_split]].mean(axis=1)])
    middle = middles[sides.of_faces]
    n_split = (middle >= 0).sum(axis=1)
    first = np.where(n_split == 1, (middle >= 0).argmax(axis=1), 0)
    first = np.where(n_split == 2, ((middle < 0).argmax(axis=1) + 1) % 3, first)
    rotated = (first[:, None] + np.arange(3)) % 3
    points = np.hstack(
        [np.take_along_axis(faces, rotated, 1), np.take_along_axis(middle, rotated, 1)]
    )
    corners = np.take_along_axis(key.weights, rotated[:, :, None], 1)
    weights = np.hstack([corners, (corners + np.roll(corners, -1, axis=1)) / 2])

    def distances(start: int, end: int) -> Floats:
        return np.asarray(
            np.linalg.norm(vertices[points[:, start]] - vertices[points[:, end]], axis=1)
        )

    is_shorter = distances(0, 4) <= distances(3, 2)
    cases: list[tuple[npt.NDArray[np.bool_], list[list[int]]]] = [
        (n_split == 0, WHOLE),
        (n_split == 1, ONE_SIDE),
        ((n_split == 2) & is_shorter, TWO_SIDES),
        ((n_split == 2) & ~is_shorter, TWO_SIDES_FLIPPED),
        (n_split == 3, THREE_SIDES),
    ]
    splits = [(np.flatnonzero(is_case), np.array(parts)) for is_case, parts in cases]
    return KeyMesh(
        TriangleMesh(
            vertices,
            np.concatenate([points[ids][:, parts].reshape(-1, 3) for ids, parts in splits]).astype(
                np.int32
            ),
        ),
        np.concatenate([np.repeat(key.parents[ids], len(parts), axis=0) for ids, parts in splits]),
        np.concatenate([weights[ids][:, parts].reshape(-1, 3, 3) for ids, parts in splits]),
    )
