"""Vertices of a mesh as those of another one that has most of its faces, in the same order.

A mesh may lose vertices and faces in many places and gain others, for instance if a solver deletes
elements. At each place the numbers of all later vertices shift. Their order remains, so the numbers
in the other mesh, the base, ascend.
"""

from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.model.geometry.polygons import ragged_indices
from meshreel.model.sequence import Faces

MAX_VERTS = 1 << 21
"""So that the three vertices of a face fit 63 bits."""

N_ENDS, BLOCK_SIZE = 128, 32
"""Vertices at each end of the meshes, and in the blocks of them that are compared first."""

SIMILAR = 11 / 16
"""Share of a block that must have as many faces as in the base; most pairs are unrelated."""

MAX_END_SHIFT = 8
"""Vertices that are dropped or inserted before a block at the end, at most."""

MAX_FILLED = 256
"""Vertices between two others that are taken for those between their numbers, at most."""

REACH, WIDE_REACH = 8, 64
"""Vertices that are guessed at each end of a run of vertices without numbers.

Many of them share faces only if the numbers follow the surface; more are more often wrong.
"""

N_BLOCKS = 64
"""Blocks of vertices that are searched for in the base by the numbers of their faces."""

MAX_SHIFTS = 4096
"""Difference of the numbers of vertices up to which blocks are searched for, which takes time."""

MAX_ROUNDS, MIN_GROWTH = 8, 1.002
"""Rounds of guessing, and how many times the faces of the last round one must find to go on."""

ENOUGH = 0.9
"""Share of the faces of the smaller mesh at which no other guess is tried."""


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

    @cached_property
    def sides(self) -> tuple[Integers, Integers]:
        """Keys ``V * first + second`` of all sides, ascending, and the vertex opposite to each."""
        first, second, opposite = _sides(self.faces)
        keys = first * self.n_verts + second
        order = np.argsort(keys, kind="stable")
        return keys[order], opposite[order]

    @cached_property
    def degrees(self) -> Integers:
        """Number of faces at each vertex."""
        return np.bincount(self.faces.ravel(), minlength=self.n_verts)

    @cached_property
    def corners(self) -> Integers:
        """Numbers ``3 i + k`` of the corners k of all faces i, by vertex."""
        return np.argsort(self.faces.ravel(), kind="stable")

    @cached_property
    def corner_starts(self) -> Integers:
        """Place of the first corner of each vertex."""
        return np.cumsum(self.degrees) - self.degrees

    def contains(self, faces: npt.NDArray[np.integer]) -> npt.NDArray[np.bool_]:
        """Whether each face is one of these; its vertices may be outside of 0..V-1."""
        keys = self.keys(faces)
        at = np.searchsorted(self.sorted_keys, keys)
        is_inside = (faces.min(axis=1) >= 0) & (faces.max(axis=1) < self.n_verts)
        result: npt.NDArray[np.bool_] = is_inside & (
            self.sorted_keys[np.minimum(at, len(self.faces) - 1)] == keys
        )
        return result


def match_vertices(base: FaceIndex, faces: Faces, n_verts: int) -> Integers | None:
    """Return the number of each vertex in the base, ascending, or -1; None if meshes are unrelated.

    Numbers are guessed for a few vertices, then spread across faces: two vertices of a face lead to
    the side of the base with their numbers, which gives the number of the third. Vertices whose
    faces the base does not have were guessed wrong and lose their numbers.

    Parameters
    ----------
    base : FaceIndex
    faces : int32 array of shape (M, 3)
    n_verts : int
        V.
    """
    mesh = FaceIndex(faces, n_verts)
    if not _has_similar_ends(base.degrees, mesh.degrees):
        return None
    enough = ENOUGH * min(len(base.faces), len(faces))
    best, n_best = np.full(n_verts, -1), 0
    for is_last_chance, numbers in _guesses(base, mesh.degrees):
        numbers, n_found = _verified(base, mesh, numbers)
        if n_found > n_best:
            best, n_best = numbers, n_found
        if n_best >= enough:
            break
        if is_last_chance and n_best == 0:
            return None
    return _continued(best, base.n_verts, fill=n_verts)


def _has_similar_ends(degrees: Integers, others: Integers) -> bool:
    """Whether vertices near the first or the last have as many faces as in the base."""
    n = min(N_ENDS, len(degrees), len(others))
    size = min(BLOCK_SIZE, n)
    ends = [(degrees[:n], others[:n]), (degrees[: -n - 1 : -1], others[: -n - 1 : -1])]
    for first, second in ends:
        padded = np.pad(first, MAX_END_SHIFT, constant_values=-1)
        windows = np.lib.stride_tricks.sliding_window_view(padded, size)
        for start in range(0, n - size + 1, size):
            shifted = windows[start : start + 2 * MAX_END_SHIFT + 1]
            is_equal = shifted == second[start : start + size]
            if np.count_nonzero(is_equal, axis=1).max() >= SIMILAR * size:
                return True
    return False


def _guesses(base: FaceIndex, degrees: Integers) -> Iterator[tuple[bool, Integers]]:
    """Yield numbers of some vertices, the most likely guess first.

    With them, whether meshes are unrelated if no face is found with this guess or one before it.
    """
    none = np.full(len(degrees), -1)
    yield False, _continued(none, base.n_verts, reach=REACH)
    yield False, _continued(none, base.n_verts, reach=WIDE_REACH)
    yield True, _numbers_by_degrees(base.degrees, degrees)
    yield False, _continued(none, base.n_verts, reach=REACH, last=False)
    yield False, _continued(none, base.n_verts, reach=REACH, first=False)


def _numbers_by_degrees(degrees: Integers, others: Integers) -> Integers:
    """Return the numbers of blocks of vertices whose degrees are found in the base, and else -1.

    Only in one place each; the more vertices precede a block, the further its numbers shift.
    """
    numbers = np.full(len(others), -1)
    shift, size = len(degrees) - len(others), min(BLOCK_SIZE, len(degrees), len(others))
    if abs(shift) > MAX_SHIFTS:
        return numbers
    starts = np.unique(np.linspace(0, len(others) - size, N_BLOCKS).astype(np.int64))
    blocks = others[starts[:, None] + np.arange(size)]
    shifts = np.arange(min(shift, 0), max(shift, 0) + 1)
    outside = np.full(max(-shift, 0), -1)  # vertices with a number that the base does not have
    padded = np.concatenate([outside, degrees, outside])
    windows = np.lib.stride_tricks.sliding_window_view(padded, size)
    n_equal = np.zeros((len(starts), len(shifts)), np.int64)
    for row, start, block in zip(n_equal, starts, blocks, strict=True):
        row[:] = np.count_nonzero(windows[start : start + len(shifts)] == block, axis=1)
    most = n_equal.max(axis=1)
    is_unique = np.count_nonzero(n_equal == most[:, None], axis=1) == 1
    found = np.flatnonzero(is_unique & (2 * most > size))
    of_block = shifts[n_equal[found].argmax(axis=1)]
    rank = np.abs(of_block) * len(starts) + found  # shifts may repeat
    kept = longest_ascending(rank)
    for start, own in zip(starts[found[kept]], of_block[kept], strict=True):
        numbers[start : start + size] = np.arange(start, start + size) + own
    numbered = np.flatnonzero(numbers >= 0)
    numbers[numbered[~longest_ascending(numbers[numbered])]] = -1
    return numbers


def _verified(base: FaceIndex, mesh: FaceIndex, numbers: Integers) -> tuple[Integers, int]:
    """Return numbers that follow from guessed ones, and how many faces the base then has."""
    faces, n_last = mesh.faces, 0
    for _ in range(MAX_ROUNDS):
        numbers = _spread(base, mesh, numbers)
        of_faces = numbers[faces]
        is_numbered = of_faces.min(axis=1) >= 0
        is_found = is_numbered & base.contains(of_faces)
        n_found = int(np.count_nonzero(is_found))
        support, tests = (
            np.bincount(faces[chosen].ravel(), minlength=len(numbers))
            for chosen in (is_found, is_numbered)
        )
        is_wrong = (mesh.degrees > 0) & ((support == 0) | (2 * support < tests))
        numbers = np.where(is_wrong, -1, numbers)
        if n_found == len(faces) or n_found < MIN_GROWTH * n_last:
            break
        n_last = n_found
        guessed = _continued(numbers, base.n_verts, reach=REACH)
        if np.array_equal(guessed, numbers):
            break
        numbers = guessed
    return numbers, n_found


def _spread(base: FaceIndex, mesh: FaceIndex, numbers: Integers) -> Integers:
    """Return numbers of further vertices, which follow from those of the others in their faces."""
    keys, opposite_in_base = base.sides
    first, second, opposite = _sides(mesh.faces)
    was_open = np.ones(len(numbers), bool)
    while True:
        numbers = _continued(numbers, base.n_verts)
        new = np.flatnonzero(was_open & (numbers >= 0))
        was_open = numbers < 0
        starts = mesh.corner_starts[new]
        from_new = mesh.corners[ragged_indices(starts, mesh.degrees[new])]
        sides = np.concatenate([from_new, from_new - 1 + 3 * (from_new % 3 == 0)])
        sides = sides[
            was_open[opposite[sides]] & ~was_open[first[sides]] & ~was_open[second[sides]]
        ]
        wanted = numbers[first[sides]] * base.n_verts + numbers[second[sides]]
        at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        vertices, found = opposite[sides], opposite_in_base[at]
        known, of_known = _numbered(numbers, base.n_verts)
        behind = np.searchsorted(known, vertices)
        fits = (keys[at] == wanted) & (of_known[behind - 1] < found) & (found < of_known[behind])
        if not fits.any():
            return numbers
        vertices, which = np.unique(vertices[fits], return_index=True)
        found = found[fits][which]
        ascending = longest_ascending(found)
        numbers[vertices[ascending]] = found[ascending]


def _sides(faces: Faces) -> tuple[Integers, Integers, Integers]:
    """Return the vertices of all sides, in order, and those opposite to them."""
    wide = faces.astype(np.int64)
    first, second, opposite = (np.roll(wide, -turn, axis=1).ravel() for turn in range(3))
    return first, second, opposite


def _numbered(numbers: Integers, n_base_verts: int) -> tuple[Integers, Integers]:
    """Return all vertices with numbers, ascending, and their numbers.

    The first is vertex -1 with the number -1, the last V with the number of the base's vertices.
    """
    known = np.concatenate([[-1], np.flatnonzero(numbers >= 0), [len(numbers)]])
    return known, np.concatenate([[-1], numbers[known[1:-1]], [n_base_verts]])


def _continued(
    numbers: Integers,
    n_base_verts: int,
    *,
    fill: int = MAX_FILLED,
    reach: int = 0,
    first: bool = True,
    last: bool = True,
) -> Integers:
    """Return numbers also of vertices between others where the base has as many.

    Parameters
    ----------
    fill : int
        Length of the runs that are filled if the base has as many vertices there.
    reach : int
        Number of vertices at each end of other runs that continue the numbers before or behind
        them, if the run has at least four times as many in both meshes.
    first, last : bool
        At which ends.
    """
    known, of_known = _numbered(numbers, n_base_verts)
    runs = np.flatnonzero(np.diff(known) > 1)
    before, behind = known[runs], known[runs + 1]
    low, high = of_known[runs], of_known[runs + 1]
    lengths, others = behind - before - 1, high - low - 1
    reached = np.minimum(np.minimum(lengths, others) // 4, reach)
    is_filled = (lengths == others) & (lengths <= fill)
    forward = np.where(is_filled, lengths, reached * first)
    backward = np.where(is_filled, 0, reached * last)
    result = numbers.copy()
    ends = (before + 1, forward, low - before), (behind - backward, backward, high - behind)
    for starts, counts, shifts in ends:
        vertices = ragged_indices(starts, counts)
        result[vertices] = vertices + np.repeat(shifts, counts)
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
