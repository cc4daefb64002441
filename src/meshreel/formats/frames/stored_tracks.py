"""Tracks whose values stay in their files until they are read."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from meshreel.arrays import Values
from meshreel.errors import InvalidInputError
from meshreel.model.surface import Domain
from meshreel.model.tracks import TrackKind, check_kind


@dataclass(frozen=True, eq=False)
class StoredTrack:
    """A `TrackSource` whose values are in files.

    Parameters
    ----------
    dtype : dtype
        One of `meshreel.model.tracks.NUMBER_TYPES`, in native byte order.
    shape : tuple of int
        Frames, places and numbers of each value: (T, N, C).
    read_range : function of a start and a stop
        Reads the values of frames start..stop - 1, of shape (stop - start, N, C).

    Raises
    ------
    InvalidInputError
        If the kind does not allow the type or number of components.
    """

    domain: Domain
    kind: TrackKind
    unit: str
    dtype: np.dtype[Any]
    shape: tuple[int, int, int]
    read_range: Callable[[int, int], Values]

    def __post_init__(self) -> None:
        check_kind(self.kind, self.shape[2], self.dtype)

    def read(self, start: int, stop: int) -> Values:
        """Read the values of frames start..stop - 1, with the index rules of slices."""
        start, stop, _ = slice(start, stop).indices(self.shape[0])
        return self.read_range(start, max(start, stop))


def parse_track_kind(name: str, n_columns: int, dtype: np.dtype[Any]) -> TrackKind | None:
    """Return the track kind of a name; None if it is unknown or does not fit the values."""
    try:
        check_kind(kind := TrackKind(name), n_columns, dtype)
    except (ValueError, InvalidInputError):
        return None
    return kind
