"""Matching of the vertices of a mesh to those of another one, the base, that shares most faces.

When a solver deletes elements, a mesh loses vertices and faces in many places and may gain others.
At each place the numbers of all later vertices shift, but their order remains: ascending vertices
of the mesh match ascending vertices of the base.

A guess matches a few vertices, by their numbers or by their degrees (numbers of faces). From there
matches spread across faces that both meshes have; where faces disagree, matches are undone.
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
"""Largest number of vertices: the key of a face, made of three vertices, fits 63 bits."""

N_END_VERTICES, BLOCK_SIZE = 128, 32
"""Unrelated meshes are detected by blocks of this size among this many first and last vertices."""

MIN_EQUAL_DEGREES = 11 / 16
"""Minimum share of such a block whose degrees equal those of vertices of the base at a shift."""

MAX_END_SHIFT = 8
"""Maximum shift of such a block, which dropped or inserted vertices cause."""

MAX_EQUAL_RUN = 256
"""Longest run of unmatched vertices that is matched one to one if the base has as many there."""

REACH, WIDE_REACH = 8, 64
"""Number of vertices at each end of other runs that a guess matches one to one.

More of them lead to more shared faces if the order follows the surface, but are more often wrong.
"""

N_BLOCKS = 64
"""Number of blocks searched for in the base by the degrees of their vertices."""

MAX_SHIFTS = 4096
"""Largest difference of the numbers of vertices for this search, whose time grows with it."""

MAX_ROUNDS, MIN_GROWTH = 8, 1.002
"""Rounds of extending a guess, which end when one multiplies the shared faces by less than this."""

ENOUGH_SHARED = 0.9
"""Share of the faces of the smaller mesh that is enough to try no other guess."""


@dataclass(frozen=True, eq=False)
class FaceIndex:
    """Lookup of the faces of a mesh by their vertices."""

    faces: Faces
    """int32 array of shape (M, 3)."""
    n_verts: int
    """V, at most `MAX_VERTS`."""

    def keys(self, faces: npt.NDArray[np.integer]) -> Integers:
        """Return a key for each face, which only its vertices in the same rotation have."""
        wide = faces.astype(np.int64)
        return (wide[:, 0] * self.n_verts + wide[:, 1]) * self.n_verts + wide[:, 2]

    @cached_property
    def face_keys(self) -> Integers:
        """Keys of all faces, in order."""
        return self.keys(self.faces)

    @cached_property
    def by_key(self) -> Integers:
        """Numbers of all faces, sorted by their keys."""
        return np.argsort(self.face_keys, kind="stable")

    @cached_property
    def sorted_keys(self) -> Integers:
        """Keys of all faces, ascending."""
        return self.face_keys[self.by_key]

    @cached_property
    def sides(self) -> tuple[Integers, Integers]:
        """Keys ``V * first + second`` of all sides, ascending, and the vertex opposite to each."""
        first, second, opposite = _sides(self.faces)
        keys = first * self.n_verts + second
        order = np.argsort(keys, kind="stable")
        return keys[order], opposite[order]

    @cached_property
    def degrees(self) -> Integers:
        """Number of faces of each vertex."""
        return np.bincount(self.faces.ravel(), minlength=self.n_verts)

    @cached_property
    def corners(self) -> Integers:
        """Corners, numbered ``3 i + k`` for corner k of face i, sorted by vertex."""
        return np.argsort(self.faces.ravel(), kind="stable")

    @cached_property
    def corner_starts(self) -> Integers:
        """Index of the first corner of each vertex in `corners`."""
        return np.cumsum(self.degrees) - self.degrees

    def contains(self, faces: npt.NDArray[np.integer]) -> npt.NDArray[np.bool_]:
        """Whether the mesh has each face; its vertices may be outside of 0..V-1."""
        keys = self.keys(faces)
        index = np.minimum(np.searchsorted(self.sorted_keys, keys), len(self.faces) - 1)
        is_inside = (faces.min(axis=1) >= 0) & (faces.max(axis=1) < self.n_verts)
        return np.asarray(is_inside & (self.sorted_keys[index] == keys))


def match_vertices(base: FaceIndex, faces: Faces, n_verts: int) -> Integers | None:
    """Return the vertex of the base for each vertex, ascending, or -1; None for unrelated meshes.

    A few vertices are matched by a guess. Matches then spread across faces: if two vertices of a
    face are matched, the face of the base at the same side gives the match of the third. Vertices
    whose faces are not in the base were guessed wrong and become unmatched.

    Parameters
    ----------
    faces : int32 array of shape (M, 3)
    n_verts : int
        V.
    """
    mesh = FaceIndex(faces, n_verts)
    if not _has_similar_ends(base.degrees, mesh.degrees):
        return None
    enough_shared = ENOUGH_SHARED * min(len(base.faces), len(faces))
    best, n_best = np.full(n_verts, -1), 0
    for is_decisive, guess in _guesses(base, mesh.degrees):
        matches, n_shared = _extend(base, mesh, guess)
        if n_shared > n_best:
            best, n_best = matches, n_shared
        if n_best >= enough_shared:
            break
        if is_decisive and n_best == 0:
            return None
    return _match_runs(best, base.n_verts, max_equal_run=n_verts)


def _has_similar_ends(base_degrees: Integers, degrees: Integers) -> bool:
    """Whether a block near the first or the last vertices has the degrees of one in the base."""
    n = min(N_END_VERTICES, len(base_degrees), len(degrees))
    size = min(BLOCK_SIZE, n)
    ends = [(base_degrees[:n], degrees[:n]), (base_degrees[: -n - 1 : -1], degrees[: -n - 1 : -1])]
    for base_end, end in ends:
        padded = np.pad(base_end, MAX_END_SHIFT, constant_values=-1)
        windows = np.lib.stride_tricks.sliding_window_view(padded, size)
        for start in range(0, n - size + 1, size):
            shifted = windows[start : start + 2 * MAX_END_SHIFT + 1]
            is_equal = shifted == end[start : start + size]
            if np.count_nonzero(is_equal, axis=1).max() >= MIN_EQUAL_DEGREES * size:
                return True
    return False


def _guesses(base: FaceIndex, degrees: Integers) -> Iterator[tuple[bool, Integers]]:
    """Yield matches of some vertices, the most likely guess first.

    The flag says whether meshes are unrelated if no guess so far leads to a shared face.
    """
    none = np.full(len(degrees), -1)
    yield False, _match_runs(none, base.n_verts, reach=REACH)
    yield False, _match_runs(none, base.n_verts, reach=WIDE_REACH)
    yield True, _matches_by_degrees(base.degrees, degrees)
    yield False, _match_runs(none, base.n_verts, reach=REACH, at_end=False)
    yield False, _match_runs(none, base.n_verts, reach=REACH, at_start=False)


def _matches_by_degrees(base_degrees: Integers, degrees: Integers) -> Integers:
    """Match blocks of vertices whose sequence of degrees occurs at exactly one place of the base.

    Shifts of consecutive blocks must grow, as more dropped or inserted vertices precede them.

    Parameters
    ----------
    base_degrees, degrees : integer arrays of shapes (V_b,) and (V,)
    """
    matches = np.full(len(degrees), -1)
    shift, size = len(base_degrees) - len(degrees), min(BLOCK_SIZE, len(base_degrees), len(degrees))
    if abs(shift) > MAX_SHIFTS:
        return matches
    starts = np.unique(np.linspace(0, len(degrees) - size, N_BLOCKS).astype(np.int64))
    blocks = degrees[starts[:, None] + np.arange(size)]
    shifts = np.arange(min(shift, 0), max(shift, 0) + 1)
    padding = np.full(max(-shift, 0), -1)  # for shifts beyond the vertices of the base
    padded = np.concatenate([padding, base_degrees, padding])
    windows = np.lib.stride_tricks.sliding_window_view(padded, size)
    n_equal = np.zeros((len(starts), len(shifts)), np.int64)
    for row, start, block in zip(n_equal, starts, blocks, strict=True):
        row[:] = np.count_nonzero(windows[start : start + len(shifts)] == block, axis=1)
    max_equal = n_equal.max(axis=1)
    is_unique = np.count_nonzero(n_equal == max_equal[:, None], axis=1) == 1
    unique_blocks = np.flatnonzero(is_unique & (2 * max_equal > size))
    unique_shifts = shifts[n_equal[unique_blocks].argmax(axis=1)]
    rank = np.abs(unique_shifts) * len(starts) + unique_blocks  # equal shifts are ascending too
    is_ascending = longest_ascending(rank)
    for start, shift in zip(
        starts[unique_blocks[is_ascending]], unique_shifts[is_ascending], strict=True
    ):
        matches[start : start + size] = np.arange(start, start + size) + shift
    matched = np.flatnonzero(matches >= 0)
    matches[matched[~longest_ascending(matches[matched])]] = -1
    return matches


def _extend(base: FaceIndex, mesh: FaceIndex, matches: Integers) -> tuple[Integers, int]:
    """Extend guessed matches; return them, and the number of shared faces."""
    faces, n_last = mesh.faces, 0
    for _ in range(MAX_ROUNDS):
        matches = _spread_across_faces(base, mesh, matches)
        faces_in_base = matches[faces]
        is_matched = faces_in_base.min(axis=1) >= 0
        is_shared = is_matched & base.contains(faces_in_base)
        n_shared = int(np.count_nonzero(is_shared))
        n_shared_at, n_matched_at = (
            np.bincount(faces[selected].ravel(), minlength=len(matches))
            for selected in (is_shared, is_matched)
        )
        is_wrong = (mesh.degrees > 0) & ((n_shared_at == 0) | (2 * n_shared_at < n_matched_at))
        matches = np.where(is_wrong, -1, matches)
        if n_shared == len(faces) or n_shared < MIN_GROWTH * n_last:
            break
        n_last = n_shared
        guess = _match_runs(matches, base.n_verts, reach=REACH)
        if np.array_equal(guess, matches):
            break
        matches = guess
    return matches, n_shared


def _spread_across_faces(base: FaceIndex, mesh: FaceIndex, matches: Integers) -> Integers:
    """Match further vertices by the matches of the two other vertices of their faces."""
    keys, opposite_in_base = base.sides
    first, second, opposite = _sides(mesh.faces)
    was_unmatched = np.ones(len(matches), bool)
    while True:
        matches = _match_runs(matches, base.n_verts)
        new = np.flatnonzero(was_unmatched & (matches >= 0))
        was_unmatched = matches < 0
        # Sides with a newly matched end, whose opposite vertex is unmatched.
        starts = mesh.corner_starts[new]
        from_new = mesh.corners[ragged_indices(starts, mesh.degrees[new])]
        sides = np.concatenate([from_new, from_new - 1 + 3 * (from_new % 3 == 0)])
        are_ends_matched = ~was_unmatched[first[sides]] & ~was_unmatched[second[sides]]
        sides = sides[was_unmatched[opposite[sides]] & are_ends_matched]
        side_keys = matches[first[sides]] * base.n_verts + matches[second[sides]]
        index = np.minimum(np.searchsorted(keys, side_keys), len(keys) - 1)
        vertices, candidates = opposite[sides], opposite_in_base[index]
        # A candidate must lie between the matches of the nearest matched vertices.
        matched, in_base = _matched_pairs(matches, base.n_verts)
        after = np.searchsorted(matched, vertices)
        is_between = (in_base[after - 1] < candidates) & (candidates < in_base[after])
        fits = (keys[index] == side_keys) & is_between
        if not fits.any():
            return matches
        vertices, first_fits = np.unique(vertices[fits], return_index=True)
        candidates = candidates[fits][first_fits]
        ascending = longest_ascending(candidates)
        matches[vertices[ascending]] = candidates[ascending]


def _sides(faces: Faces) -> tuple[Integers, Integers, Integers]:
    """Return the two ends of all sides, and the vertices opposite to them."""
    wide = faces.astype(np.int64)
    first, second, opposite = (np.roll(wide, -turn, axis=1).ravel() for turn in range(3))
    return first, second, opposite


def _matched_pairs(matches: Integers, n_base_verts: int) -> tuple[Integers, Integers]:
    """Return all matched vertices, ascending, and their matches.

    Vertex -1 with the match -1 precedes them, vertex V with the match V_b follows.
    """
    matched = np.concatenate([[-1], np.flatnonzero(matches >= 0), [len(matches)]])
    return matched, np.concatenate([[-1], matches[matched[1:-1]], [n_base_verts]])


def _match_runs(
    matches: Integers,
    n_base_verts: int,
    *,
    max_equal_run: int = MAX_EQUAL_RUN,
    reach: int = 0,
    at_start: bool = True,
    at_end: bool = True,
) -> Integers:
    """Also match runs of unmatched vertices: whole runs if the base has equally many there.

    Parameters
    ----------
    max_equal_run : int
        Longest such run.
    reach : int
        Number of vertices at the start and the end of other runs that continue the matches before
        or after them, if both meshes have at least four times as many vertices there.
    at_start, at_end : bool
        Whether to match vertices at the start and the end of other runs.
    """
    matched, in_base = _matched_pairs(matches, n_base_verts)
    runs = np.flatnonzero(np.diff(matched) > 1)
    before, after = matched[runs], matched[runs + 1]
    low, high = in_base[runs], in_base[runs + 1]
    lengths, base_lengths = after - before - 1, high - low - 1
    n_reached = np.clip(np.minimum(lengths, base_lengths) // 4, 0, reach)  # matches may descend
    is_filled = (lengths == base_lengths) & (lengths <= max_equal_run)
    forward = np.where(is_filled, lengths, n_reached * at_start)
    backward = np.where(is_filled, 0, n_reached * at_end)
    result = matches.copy()
    ends = (before + 1, forward, low - before), (after - backward, backward, high - after)
    for starts, counts, shifts in ends:
        vertices = ragged_indices(starts, counts)
        result[vertices] = vertices + np.repeat(shifts, counts)
    return result


def longest_ascending(numbers: Integers) -> npt.NDArray[np.bool_]:
    """Whether each number belongs to a longest ascending subsequence."""
    selected = np.ones(len(numbers), bool)
    if (np.diff(numbers) > 0).all():
        return selected
    # Of the subsequences of each length, the smallest last number, and its index.
    last_numbers: list[int] = []
    last_indices: list[int] = []
    previous = []
    for i, number in enumerate(numbers.tolist()):
        length = bisect_left(last_numbers, number)
        previous.append(last_indices[length - 1] if length else -1)
        last_numbers[length : length + 1] = [number]
        last_indices[length : length + 1] = [i]
    selected[:] = False
    i = last_indices[-1]
    while i >= 0:
        selected[i] = True
        i = previous[i]
    return selected
