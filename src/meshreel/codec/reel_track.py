"""A track of a `.reel` file whose values are decoded on demand."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values
from meshreel.codec.methods import FrameReader
from meshreel.codec.open_stream import OpenStream
from meshreel.codec.surface.codes import DOMAINS
from meshreel.codec.tracks import KINDS
from meshreel.errors import InvalidInputError
from meshreel.kernel.files import FileModes, FrameDecoder
from meshreel.model.frame_choice import FrameChoice, chosen_frames, consecutive_runs
from meshreel.model.surface import Domain
from meshreel.model.tracks import TrackKind, describe_track
from meshreel.runtime.counting import counted


class ReelTrack:
    """A track of a `.reel` file; returned by `ReelFile.track`.

    ``len(track)`` is the number of frames. ``track[3]`` is the values of a frame, of shape (N, C);
    slices and lists of numbers return several frames, of shape (T, N, C). Only this track is read
    and decoded, with positions if they predict it (velocities and normals). Threads may share it.

    Parameters
    ----------
    frames : FrameReader
    number : int
        Number of the track in the stream, at least 1.

    Attributes
    ----------
    name, unit : str
    kind : TrackKind
    domain : Domain
        Faces are polygons, and corners are corners of polygons.
    dtype : numpy dtype
    is_exact : bool
        Whether its numbers are lossless.
    error_bound : float or None
        Guaranteed largest error of a value: the length of the difference, in the unit of the track;
        for normals the angle in degrees; for colors the difference of each number. None if the
        stream guarantees none.
    """

    def __init__(self, opened: OpenStream, frames: FrameReader, number: int) -> None:
        self._opened, self._frames = opened, frames
        self._number = number
        track = opened.file.tracks[number]
        self.name: str = track.name
        self.unit: str = track.unit
        self.dtype: np.dtype[Any] = track.dtype
        self.kind: TrackKind = KINDS[track.kind]
        self.domain: Domain = DOMAINS[track.domain]
        self.is_exact: bool = track.is_exact
        self.error_bound: float | None = 0.0 if track.is_exact else track.bound or None

    @property
    def shape(self) -> tuple[int, int, int]:
        """Frames, items (vertices, faces or corners) and columns: (T, N, C)."""
        track = self._opened.file.tracks[self._number]
        return self._opened.n_frames, track.n_items, track.n_columns

    @property
    def frame_bytes(self) -> int:
        """Size of the values of a frame."""
        return self._opened.file.tracks[self._number].frame_bytes

    def read(self, start: int, stop: int) -> Values:
        """Decode values of frames start..stop - 1, of shape (stop - start, N, C).

        Raises
        ------
        InvalidInputError
            If these frames do not exist.
        CorruptStreamError
            If a block is damaged.
        MemoryLimitError
            If the values of these frames, or of a block, take more memory than allowed.
        """
        return read_frames(self._opened, self._frames, self._number, start, stop)

    def __len__(self) -> int:
        return self._opened.n_frames

    def __getitem__(self, chosen: FrameChoice) -> Values:
        """Values of a frame, of shape (N, C), or of several, of shape (T, N, C)."""
        numbers = chosen_frames(chosen, len(self))
        if isinstance(numbers, int):
            return np.asarray(self.read(numbers, numbers + 1)[0])
        if isinstance(numbers, range) and numbers.step == 1:
            return self.read(numbers.start, max(numbers.start, numbers.stop))
        return self.frames(np.asarray(numbers, np.int64))

    def frames(self, numbers: npt.ArrayLike, out: Values | None = None) -> Values:
        """Decode values of several frames; `ReelFile.frames` describes parameters and errors.

        Returns
        -------
        array of shape (..., N, C)
            With the shape of `numbers` in front.
        """
        return decode_frames(self._opened, self._frames, self._number, numbers, out)

    def modes(self, block: int) -> FileModes | None:
        """Return the modes of a block, as `ReelFile.modes`."""
        return modes_of_block(self._frames, block, self._number)

    def __iter__(self) -> Iterator[Values]:
        for number in range(len(self)):
            yield self[number]

    def __repr__(self) -> str:
        return f"<ReelTrack {self.name!r}: {describe_track(self)}, {counted(len(self), 'frame')}>"


def read_frames(
    opened: OpenStream, reader: FrameReader, track: int, start: int, stop: int
) -> Values:
    """Decode consecutive frames of a track, 0 for the positions; see `ReelFile.read`."""
    if not 0 <= start <= stop <= opened.n_frames:
        raise InvalidInputError(
            f"frames {start}:{stop} are not in the file; it has frames 0:{opened.n_frames}"
        )
    stored = opened.file.tracks[track]
    owner = f"track {stored.name!r}" if track else f"{opened.n_verts} vertices"
    opened.limit.require((stop - start) * stored.frame_bytes, f"frames {start}:{stop} of {owner}")
    if start < stop:  # a damaged block raises before memory is allocated
        reader.load(opened.file.block_of_frame(start), track)
    values = np.empty((stop - start, stored.n_items, stored.n_columns), stored.dtype)
    reader.fill(values, start, track)
    return values


def decode_frames(
    opened: OpenStream,
    reader: FrameReader,
    track: int,
    numbers: npt.ArrayLike,
    out: Values | None = None,
) -> Values:
    """Decode frames of a track; see `ReelFile.frames`."""
    flat = np.asarray(chosen_frames(np.ravel(numbers), opened.n_frames), np.int64)
    stored = opened.file.tracks[track]
    shape = (*np.shape(numbers), stored.n_items, stored.n_columns)
    if out is None:
        opened.limit.require(len(flat) * stored.frame_bytes, counted(len(flat), "frame"))
        out = np.empty(shape, stored.dtype)
    elif out.shape != shape or out.dtype != stored.dtype or not out.flags.c_contiguous:
        raise InvalidInputError(
            f"out must be a contiguous {stored.dtype} array of shape {shape}; got {out.dtype} "
            f"of shape {out.shape}"
        )
    frames = out.reshape(len(flat), *shape[-2:])
    for place, run in consecutive_runs(flat):  # in the order of the file: no block is loaded twice
        reader.fill(frames[place : place + len(run)], run.start, track)
    return out


def modes_of_block(reader: FrameReader, block: int, track: int) -> FileModes | None:
    """Return the modes of a track in a block; see `ReelFile.modes`."""
    return reader.modes(block, track) if isinstance(reader, FrameDecoder) else None
