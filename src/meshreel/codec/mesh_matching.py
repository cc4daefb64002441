"""Vertices of a mesh as those of another one that has most of its faces, in the same order."""

from bisect import bisect_left
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.model.sequence import Faces

MAX_VERTS = 1 << 21
"""So that the three vertices of a face fit 63 bits."""


@dataclass(frozen=True, eq=False)
class FaceIndex:
    """The faces of a mesh, found by their vertices.

    Attributes
    ----------
    faces : int32 array of shape (M, 3)
    n_verts : int
        V, at most `MAX_VERTS`.
    """

    faces: Faces
    n_verts: int

    def keys(self, faces: npt.NDArray[np.integer]) -> Integers:
        """Return a number for each face that no other oriented and rotated triangle has."""
        wide = faces.astype(np.int64)
        return (wide[:, 0] * self.n_verts + wide[:, 1]) * self.n_verts + wide[:, 2]

    @cached_property
    def own_keys(self) -> Integers:
        """Keys of all faces, in order."""
        return self.keys(self.faces)

    @cached_property
    def by_key(self) -> Integers:
        """Numbers of all faces, sorted by their keys."""
        return np.argsort(self.own_keys, kind="stable")

    @cached_property
    def sorted_keys(self) -> Integers:
        """Keys of all faces, ascending."""
        return self.own_keys[self.by_key]

    def contains(self, faces: npt.NDArray[np.integer]) -> npt.NDArray[np.bool_]:
        """Whether each face is one of these; its vertices may be outside of 0..V-1."""
        keys = self.keys(faces)
        at = np.searchsorted(self.sorted_keys, keys)
        is_inside = (faces.min(axis=1) >= 0) & (faces.max(axis=1) < self.n_verts)
        result: npt.NDArray[np.bool_] = is_inside & (
            self.sorted_keys[np.minimum(at, len(self.faces) - 1)] == keys
        )
        return result


def longest_ascending(numbers: Integers) -> npt.NDArray[np.bool_]:
    """Whether each number belongs to a longest ascending subsequence."""
    selected = np.ones(len(numbers), bool)
    if (np.diff(numbers) > 0).all():
        return selected
    ends: list[int] = []
    at_end: list[int] = []
    previous = []
    for i, number in enumerate(numbers.tolist()):
        place = bisect_left(ends, number)
        previous.append(at_end[place - 1] if place else -1)
        ends[place : place + 1] = [number]
        at_end[place : place + 1] = [i]
    selected[:] = False
    i = at_end[-1]
    while i >= 0:
        selected[i] = True
        i = previous[i]
    return selected
