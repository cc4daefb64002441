"""A track of a `.reel` file whose values are decoded on demand."""

from collections import OrderedDict
from collections.abc import Iterator
from contextlib import AbstractContextManager
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.codec.methods import TrackBlockDecoder
from meshreel.codec.open_stream import OpenStream
from meshreel.counting import counted
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.frame_choice import FrameChoice, chosen_frames
from meshreel.surface import Domain
from meshreel.tracks import TrackKind, described_track

Values = npt.NDArray[Any]

N_KEPT_BLOCKS = 2
"""Decoded blocks that are kept, so that seeking across a border costs nothing."""


class ReelTrack:
    """A track of a `.reel` file; returned by `ReelFile.track`.

    Its length is the number of frames. ``track[3]`` is the values of a frame, of shape (N, C); a
    slice, or a list of numbers, gives those of several, of shape (T, N, C). Nothing but this track
    is read and decoded for it, and positions where they predict it: of velocities and normals.
    Several threads may share one.

    Parameters
    ----------
    opened : OpenStream
    number : int
        Of the track in the stream, from 1 on.
    lock : reentrant lock
        Held while the file is read.

    Attributes
    ----------
    name, unit : str
    kind : TrackKind
    domain : Domain
        Where its values are; faces are polygons, corners are theirs.
    dtype : numpy dtype
    is_exact : bool
        Whether its numbers are those of the original.
    promised_error : float or None
        Largest error of a value that the encoder has made sure of: the length of the difference,
        in the unit of the track; of normals the angle in degrees; of colours that of each number.
        None if nothing is promised.
    """

    def __init__(self, opened: OpenStream, number: int, lock: AbstractContextManager[Any]) -> None:
        self._opened = opened
        self._number = number
        self._lock = lock
        self._kept: OrderedDict[int, Values] = OrderedDict()
        header = opened.tracks[number - 1]
        self.name, self.unit, self.dtype = header.name, header.unit, header.dtype
        self.kind: TrackKind = header.kind
        self.domain: Domain = header.domain
        self.is_exact = header.is_exact
        self.promised_error = 0.0 if header.is_exact else header.bound or None

    @property
    def shape(self) -> tuple[int, int, int]:
        """Frames, vertices or faces or corners, and numbers of each value: (T, N, C)."""
        opened = self._opened
        with self._lock:
            n_items = opened.n_verts
            if self.domain is not Domain.VERTEX:
                n_faces = opened.stream.header.n_faces
                n_items = opened.surface.n_items(self.domain, opened.n_verts, n_faces)
        return opened.stream.n_frames, n_items, opened.tracks[self._number - 1].n_columns

    @property
    def frame_bytes(self) -> int:
        """Size of the values of a frame."""
        _, n_items, n_columns = self.shape
        return n_items * n_columns * self.dtype.itemsize

    @cached_property
    def _decoder(self) -> TrackBlockDecoder:
        return self._opened.method.track_decoder(self._opened, self._number)

    def read(self, start: int, stop: int) -> Values:
        """Values of frames start..stop - 1, of shape (stop - start, N, C).

        Raises
        ------
        InvalidInputError
            If these frames do not exist.
        CorruptStreamError
            If a block is damaged.
        MemoryLimitError
            If the values of these frames, or of a block, take more memory than allowed.
        """
        starts = self._opened.stream.starts
        if not 0 <= start <= stop <= starts[-1]:
            raise InvalidInputError(
                f"frames {start}:{stop} are not in the file; it has frames 0:{starts[-1]}"
            )
        self._opened.limit.require(
            (stop - start) * self.frame_bytes, f"frames {start}:{stop} of track {self.name!r}"
        )
        first = int(np.searchsorted(starts, start, side="right")) - 1
        parts = []
        for number in range(first, len(starts) - 1):
            begin, end = max(start, starts[number]), min(stop, starts[number + 1])
            if begin < end:
                parts.append(self._block(number)[begin - starts[number] : end - starts[number]])
        if not parts:
            return np.empty((0, *self.shape[1:]), self.dtype)
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def _block(self, number: int) -> Values:
        with self._lock:
            if number not in self._kept:
                self._kept[number] = self._decoder.block(number)
            self._kept.move_to_end(number)
            while len(self._kept) > N_KEPT_BLOCKS:
                self._kept.popitem(last=False)
            return self._kept[number]

    def __len__(self) -> int:
        return self._opened.stream.n_frames

    def __getitem__(self, chosen: FrameChoice) -> Values:
        """Values of a frame, of shape (N, C), or of several, of shape (T, N, C)."""
        numbers = chosen_frames(chosen, len(self))
        if isinstance(numbers, int):
            return np.asarray(self.read(numbers, numbers + 1)[0])
        if isinstance(numbers, range) and numbers.step == 1:
            return self.read(numbers.start, max(numbers.start, numbers.stop))
        # In the order of the file, so that no block is decoded twice.
        in_order, places = np.unique(np.asarray(numbers, np.int64), return_inverse=True)
        values = [self.read(number, number + 1) for number in in_order.tolist()]
        found = np.concatenate(values) if values else np.empty((0, *self.shape[1:]), self.dtype)
        return found[places]

    def __iter__(self) -> Iterator[Values]:
        for number in range(len(self)):
            yield self[number]

    def __repr__(self) -> str:
        return f"<ReelTrack {self.name!r}: {described_track(self)}, {counted(len(self), 'frame')}>"


def tracks_of_stream(opened: OpenStream, lock: AbstractContextManager[Any]) -> dict[str, ReelTrack]:
    """The tracks of a stream by their names.

    Raises
    ------
    CorruptStreamError
        If two have one name.
    """
    numbers = range(1, len(opened.tracks) + 1)
    found = {header.name: number for header, number in zip(opened.tracks, numbers, strict=True)}
    if len(found) < len(opened.tracks):
        raise CorruptStreamError("two tracks of the stream have one name")
    return {name: ReelTrack(opened, number, lock) for name, number in found.items()}
