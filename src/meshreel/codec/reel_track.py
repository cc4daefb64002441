"""Positions and tracks of a `.reel` file whose values are decoded on demand."""

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
from meshreel.kernel.files import FileModes, FileTrack, FrameDecoder
from meshreel.model.frame_choice import FrameChoice, chosen_frames, consecutive_runs
from meshreel.model.surface import Domain
from meshreel.model.tracks import BLOCK_BYTES, TrackKind, describe_track
from meshreel.runtime.counting import counted


class DecodedValues:
    """Frames of the positions or of a track of a stream, decoded on demand.

    Parameters
    ----------
    number : int
        Number of the track in the stream; 0 is the positions.
    """

    def __init__(self, opened: OpenStream, frames: FrameReader, number: int) -> None:
        self._opened, self._frames, self._number = opened, frames, number
        self._stored: FileTrack = opened.file.tracks[number]

    @property
    def shape(self) -> tuple[int, int, int]:
        """Frames, items (vertices, faces or corners) and columns: (T, N, C)."""
        return self._opened.n_frames, self._stored.n_items, self._stored.n_columns

    @property
    def frame_bytes(self) -> int:
        """Size of the values of a frame."""
        return self._stored.frame_bytes

    def __len__(self) -> int:
        return self._opened.n_frames

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
        opened, header = self._opened, self._stored
        if not 0 <= start <= stop <= len(self):
            raise InvalidInputError(
                f"frames {start}:{stop} are not in the file; it has frames 0:{len(self)}"
            )
        owner = f"track {header.name!r}" if self._number else f"{opened.n_verts} vertices"
        n_bytes = (stop - start) * header.frame_bytes
        opened.limit.require(n_bytes, f"frames {start}:{stop} of {owner}")
        if start < stop:  # a damaged block raises before memory is allocated
            self._frames.load(opened.file.block_of_frame(start), self._number)
        values = np.empty((stop - start, *self.shape[1:]), header.dtype)
        self._frames.fill(values, start, self._number)
        return values

    def frames(self, numbers: npt.ArrayLike, out: Values | None = None) -> Values:
        """Decode values of several frames; `ReelFile.frames` describes parameters and errors.

        Returns
        -------
        array of shape (..., N, C)
            With the shape of `numbers` in front.
        """
        flat = np.asarray(chosen_frames(np.ravel(numbers), len(self)), np.int64)
        dtype, shape = self._stored.dtype, (*np.shape(numbers), *self.shape[1:])
        if out is None:
            self._opened.limit.require(len(flat) * self.frame_bytes, counted(len(flat), "frame"))
            out = np.empty(shape, dtype)
        elif out.shape != shape or out.dtype != dtype or not out.flags.c_contiguous:
            raise InvalidInputError(
                f"out must be a contiguous {dtype} array of shape {shape}; got {out.dtype} of "
                f"shape {out.shape}"
            )
        frames = out.reshape(len(flat), *shape[-2:])
        for start, run in consecutive_runs(flat):  # in file order, so each block is loaded once
            self._frames.fill(frames[start : start + len(run)], run.start, self._number)
        return out

    def modes(self, block: int) -> FileModes | None:
        """Return the modes of a block, as `ReelFile.modes`."""
        reader = self._frames
        return reader.modes(block, self._number) if isinstance(reader, FrameDecoder) else None


class ReelTrack(DecodedValues):
    """A track of a `.reel` file; returned by `ReelFile.track`.

    ``len(track)`` is the number of frames. ``track[3]`` is the values of a frame, of shape (N, C);
    slices and lists of numbers return several frames, of shape (T, N, C); ``track[:, nodes]``
    selects from them as NumPy does, a few frames at a time. Only this track is read and decoded,
    with positions if they predict it (velocities and normals). Threads may share it.

    Parameters
    ----------
    opened, frames, number
        As of `DecodedValues`; the number is at least 1.

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
        Guaranteed largest error of a value relative to the original: the length of the difference,
        in the unit of the track; for normals the angle in degrees; for colors the difference of
        each number. None if the stream guarantees none.
    """

    def __init__(self, opened: OpenStream, frames: FrameReader, number: int) -> None:
        super().__init__(opened, frames, number)
        track = self._stored
        self.name: str = track.name
        self.unit: str = track.unit
        self.dtype: np.dtype[Any] = track.dtype
        self.kind: TrackKind = KINDS[track.kind]
        self.domain: Domain = DOMAINS[track.domain]
        self.is_exact: bool = track.is_exact
        self.error_bound: float | None = track.error_bound

    def __getitem__(self, index: FrameChoice | tuple[Any, ...]) -> Values:
        """Values of a frame, of shape (N, C), or of several, of shape (T, N, C), or some of them.

        Raises
        ------
        IndexError
            If a frame or an element does not exist.
        TypeError
            If the frames are of another type.
        """
        if isinstance(index, tuple):
            return self._selected(*index)
        numbers = chosen_frames(index, len(self))
        if isinstance(numbers, int):
            return np.asarray(self.read(numbers, numbers + 1)[0])
        if isinstance(numbers, range) and numbers.step == 1:
            return self.read(numbers.start, max(numbers.start, numbers.stop))
        return self.frames(np.asarray(numbers, np.int64))

    def _selected(self, frames: Any = slice(None), *items: Any) -> Values:
        """Values of frames at the elements and components of a NumPy index."""
        if frames is Ellipsis:
            frames, items = slice(None), (..., *items)
        numbers = chosen_frames(frames, len(self))
        if isinstance(numbers, int):
            return np.asarray(self.read(numbers, numbers + 1)[0, *items])
        is_slice = isinstance(numbers, range)
        if not is_slice or any(item is None for item in items):
            # NumPy combines lists of frames and of elements, and may put the frames last.
            chosen = slice(None) if is_slice else np.arange(len(numbers))
            return np.asarray(self.frames(numbers)[chosen, *items])
        n_per_run = max(1, BLOCK_BYTES // self.frame_bytes)
        values: list[Values] = []
        for start in range(0, len(numbers) or 1, n_per_run):
            values.append(np.array(self.frames(numbers[start : start + n_per_run])[:, *items]))
            self._opened.limit.require(sum(run.nbytes for run in values), f"values of {self!r}")
        return np.concatenate(values)

    def __iter__(self) -> Iterator[Values]:
        for number in range(len(self)):
            yield self[number]

    def __repr__(self) -> str:
        return f"<ReelTrack {self.name!r}: {describe_track(self)}, {counted(len(self), 'frame')}>"
