"""Faces of several segments that have the same values at their corners."""

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from meshreel.model.matching.corners import (
    NONE,
    Corners,
    Integers,
    distinct_faces,
    joint_numbers,
)

AMBIGUOUS_SHARE, MAX_ALIKE = 0.05, 64
"""Largest share of faces that others equal in their values, and largest number of equal faces."""


def aligned_faces(run: list[Corners]) -> tuple[Integers, Integers] | None:
    """Return the faces of all segments, and their corners in each; None if too many are alike.

    Faces are the same if the values at their corners are. Faces of a segment with equal values are
    told apart by the values opposite to their sides, then by their places.

    Returns
    -------
    values : array of shape (M, 3)
        Number of the value at each corner.
    corners : array of shape (S, M, 3)
        Number of each corner in each segment, or NONE.
    """
    own_numbers = joint_numbers(run)
    faces = [own[member.faces] for member, own in zip(run, own_numbers, strict=True)]
    stacked = np.concatenate(faces)
    first, inverse = distinct_faces(stacked)
    keys = stacked[first]
    rows = np.split(inverse, np.cumsum([len(face) for face in faces])[:-1])
    is_alike = (keys == keys[:, :1]).all(axis=1)  # such a face may begin anywhere
    for own in rows:
        counts = np.bincount(own, minlength=len(keys))
        is_alike |= counts > 1
        if counts.max() > MAX_ALIKE:
            return None
    if max(is_alike[own].mean() for own in rows) > AMBIGUOUS_SHARE:
        return None
    corners = np.full((len(run), len(keys), 3), NONE, np.int32)
    alike = _AlikeFaces(len(run))
    for number, (member, own) in enumerate(zip(run, rows, strict=True)):
        corners[number, own] = member.corners
        alike_faces = np.flatnonzero(is_alike[own])
        alike.add(
            number,
            member,
            own[alike_faces],
            alike_faces,
            own_numbers[number][member.opposite[alike_faces]],
        )
    own_keys, own_corners = alike.result()
    values = np.concatenate([keys[~is_alike], keys[own_keys]])
    return values, np.concatenate([corners[:, ~is_alike], own_corners], axis=1)


class _AlikeFaces:
    """Faces with the values of others, aligned from segment to segment."""

    def __init__(self, n_segments: int) -> None:
        self._n_segments = n_segments
        self._keys: list[int] = []
        self._corners: list[Integers] = []
        self._last: list[_Place] = []
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
        for key, own in of_key.items():
            known = self._of_key.setdefault(key, [])
            is_turnable = len(set(corners.faces[numbers[own[0]]].tolist())) == 1
            assigned = _assigned(
                [self._last[i] for i in known],
                [_Place(first[index], opposite[index]) for index in own],
                turns=3 if is_turnable else 1,
            )
            for index, (face, turn) in zip(own, assigned, strict=True):
                if face == NONE:
                    face = len(known)
                    known.append(len(self._keys))
                    self._keys.append(key)
                    self._corners.append(np.full((self._n_segments, 3), NONE, np.int32))
                    self._last.append(_Place(last[index], opposite[index]))
                self._corners[known[face]][number] = np.roll(corners.corners[numbers[index]], -turn)
                self._last[known[face]] = _Place(last[index], opposite[index]).turned(turn)

    def result(self) -> tuple[Integers, Integers]:
        """Return the number of the values of each face, and corners of shape (S, N, 3)."""
        keys = np.array(self._keys, np.int64)
        if not len(keys):
            return keys, np.zeros((self._n_segments, 0, 3), np.int32)
        return keys, np.stack(self._corners, axis=1)


class _Place(NamedTuple):
    """Positions of the corners of a face, of shape (3, 3), and values opposite to its sides."""

    points: npt.NDArray[np.float64]
    opposite: Integers

    def turned(self, turn: int) -> "_Place":
        """The place of the face that begins with another corner."""
        return _Place(np.roll(self.points, -turn, axis=0), np.roll(self.opposite, -turn))


def _assigned(
    known: Sequence[_Place], faces: Sequence[_Place], turns: int
) -> list[tuple[int, int]]:
    """Assign faces to known ones: those of equal neighbors first, then the nearest.

    Places are compared relative to the mean of all faces that are assigned here.

    Parameters
    ----------
    turns : int
        Number of corners with which a face may begin: 3 if its values are equal, otherwise 1.

    Returns
    -------
    list of (int, int)
        For each face its known one, or NONE, and by how many corners it is turned.
    """
    assigned = [(NONE, 0)] * len(faces)
    if not known:
        return assigned
    moved = np.mean([face.points for face in faces], axis=(0, 1))
    moved -= np.mean([face.points for face in known], axis=(0, 1))
    pairs = []
    for index, turn in product(range(len(faces)), range(turns)):
        points, opposite = faces[index].turned(turn)
        for number, other in enumerate(known):
            n_differing = int((opposite != other.opposite).sum())
            distance = float(np.square(points - moved - other.points).sum())
            pairs.append((n_differing, distance, index, turn, number))
    used: set[int] = set()
    for _, _, index, turn, number in sorted(pairs):
        if assigned[index][0] == NONE and number not in used:
            assigned[index] = number, turn
            used.add(number)
    return assigned
