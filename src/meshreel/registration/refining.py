"""Refinement of key meshes where they bend: edges are split, and the surface stays the same."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.registration.triangle_mesh import Indices, TriangleMesh

MAX_ANGLE = 1.0
"""Angles between faces count up to this many radians, so that edges at creases stay long enough."""


@dataclass(frozen=True, eq=False)
class KeyMesh:
    """The mesh of a key frame, whose faces are parts of the cleaned raw ones.

    Attributes
    ----------
    mesh : TriangleMesh
    parents : int64 array of shape (M,)
        The cleaned face that contains each face.
    weights : float64 array of shape (M, 3, 3)
        Barycentric coordinates of the corners of each face in its parent.
    """

    mesh: TriangleMesh
    parents: Indices
    weights: Floats

    @classmethod
    def of_mesh(cls, mesh: TriangleMesh) -> "KeyMesh":
        """Return the mesh itself."""
        n_faces = len(mesh.faces)
        return cls(mesh, np.arange(n_faces), np.tile(np.eye(3), (n_faces, 1, 1)))

    @property
    def is_refined(self) -> bool:
        """Whether an edge is split."""
        return len(np.unique(self.parents)) < len(self.parents)

    def refined(self, max_sagitta: float) -> "KeyMesh":
        """Return the mesh with edges split in halves until their sagitta is at most this.

        The sagitta is the height of an arc over an edge, given the angle between its two faces: how
        far the surface is from the edge if the edge slides along it. On boundaries, the largest
        angle at its ends counts.
        """
        key = self
        while (sides := _Sides.of_mesh(key.mesh)).sagittas.max(initial=0.0) > max_sagitta:
            key = _split(key, sides, sides.sagittas > max_sagitta)
        return key


class _Sides(NamedTuple):
    """The edges of a mesh.

    Attributes
    ----------
    ends : int64 array of shape (E, 2)
    of_faces : int64 array of shape (M, 3)
        The edge at each side; side k of a face joins its corners k and k + 1.
    sagittas : float64 array of shape (E,)
    """

    ends: Indices
    of_faces: Indices
    sagittas: Floats

    @classmethod
    def of_mesh(cls, mesh: TriangleMesh) -> "_Sides":
        sides = np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=-1).reshape(-1, 2)
        ends, of_faces = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True)
        cosines = mesh.cosines_across(mesh.neighbors)
        angles = np.zeros(len(ends))
        np.maximum.at(angles, of_faces.ravel(), np.arccos(np.clip(cosines, -1.0, 1.0)))
        at_vertices = np.zeros(len(mesh.vertices))
        np.maximum.at(at_vertices, ends, angles[:, None])
        is_boundary = np.bincount(of_faces.ravel()) == 1
        angles[is_boundary] = at_vertices[ends[is_boundary]].max(axis=1)
        lengths = np.linalg.norm(mesh.vertices[ends[:, 0]] - mesh.vertices[ends[:, 1]], axis=1)
        sagittas = np.minimum(angles, MAX_ANGLE) * lengths / 8
        return cls(ends.astype(np.int64), of_faces.reshape(-1, 3).astype(np.int64), sagittas)


WHOLE = [[0, 1, 2]]
ONE_SIDE = [[0, 3, 2], [3, 1, 2]]
TWO_SIDES = [[3, 1, 4], [0, 3, 4], [0, 4, 2]]
TWO_SIDES_OTHERWISE = [[3, 1, 4], [0, 3, 2], [3, 4, 2]]
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
    turned = (first[:, None] + np.arange(3)) % 3
    points = np.hstack(
        [np.take_along_axis(faces, turned, 1), np.take_along_axis(middle, turned, 1)]
    )
    corners = np.take_along_axis(key.weights, turned[:, :, None], 1)
    weights = np.hstack([corners, (corners + np.roll(corners, -1, axis=1)) / 2])

    def distances(one: int, other: int) -> Floats:
        return np.asarray(
            np.linalg.norm(vertices[points[:, one]] - vertices[points[:, other]], axis=1)
        )

    is_shorter = distances(0, 4) <= distances(3, 2)
    cases: list[tuple[npt.NDArray[np.bool_], list[list[int]]]] = [
        (n_split == 0, WHOLE),
        (n_split == 1, ONE_SIDE),
        ((n_split == 2) & is_shorter, TWO_SIDES),
        ((n_split == 2) & ~is_shorter, TWO_SIDES_OTHERWISE),
        (n_split == 3, THREE_SIDES),
    ]
    chosen = [(np.flatnonzero(is_case), np.array(parts)) for is_case, parts in cases]
    return KeyMesh(
        TriangleMesh(
            vertices,
            np.concatenate([points[at][:, parts].reshape(-1, 3) for at, parts in chosen]).astype(
                np.int32
            ),
        ),
        np.concatenate([np.repeat(key.parents[at], len(parts)) for at, parts in chosen]),
        np.concatenate([weights[at][:, parts].reshape(-1, 3, 3) for at, parts in chosen]),
    )
