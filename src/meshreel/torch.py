"""Datasets of `.reel` files for PyTorch: extra ``[torch]``.

    from meshreel.torch import ReelDataset, collate

    dataset = ReelDataset("captures/", window=16, normalize=True)
    loader = DataLoader(dataset, batch_size=8, shuffle=True, num_workers=4, collate_fn=collate)

ReelDataset    windows of frames by number, in any order
ReelStream     all windows of a dataset, block by block: for folders that exceed the memory
Window, Batch  what they yield, alone and collated
"""

import os
from bisect import bisect
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial, reduce
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, cast
from weakref import finalize

import numpy as np

from meshreel.codec.memory import bytes_of
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import InvalidInputError
from meshreel.formats.reel import open as open_reel
from meshreel.runtime.extras import TORCH
from meshreel.runtime.stores.address import is_remote
from meshreel.runtime.threads import in_threads, limit_cores, n_cores

if TYPE_CHECKING:
    import torch
    from torch.utils.data import Dataset, IterableDataset, get_worker_info
else:
    torch = TORCH.load()
    from torch.utils.data import Dataset, IterableDataset, get_worker_info

MAX_OPEN = 256
"""Files that a process keeps open, below the limits of operating systems."""

Key = tuple[int, int]
"""Sequence and block."""


class Window(NamedTuple):
    """Some frames of a sequence.

    Attributes
    ----------
    vertices : tensor of shape (W, V, 3)
    tracks : dict of str to tensor of shape (W, N, C)
        Requested tracks, in their own number types if these are integers.
    sequence : int
        Index of the sequence in ``dataset.sequences``.
    frames : int64 tensor of shape (W,)
        Numbers of the frames in their sequence.
    """

    vertices: "torch.Tensor"
    tracks: "dict[str, torch.Tensor]"
    sequence: int
    frames: "torch.Tensor"


class Batch(NamedTuple):
    """Windows, collated; zeros fill vertices and items that a sequence does not have.

    Attributes
    ----------
    vertices : tensor of shape (B, W, V, 3)
    tracks : dict of str to tensor of shape (B, W, N, C)
    sequence : int64 tensor of shape (B,)
    frames : int64 tensor of shape (B, W)
    n_verts : int64 tensor of shape (B,)
        Number of vertices of each window.
    """

    vertices: "torch.Tensor"
    tracks: "dict[str, torch.Tensor]"
    sequence: "torch.Tensor"
    frames: "torch.Tensor"
    n_verts: "torch.Tensor"


@dataclass(frozen=True)
class SequenceEntry:
    """A sequence of a dataset: a file, or a segment of a file with several.

    Attributes
    ----------
    path : str
    segment : int
        Number of the segment in the file.
    n_frames, n_verts, n_faces : int
    fps : float
        0 = unknown.
    starts : tuple of int
        First frame of each block, and the number of all frames.
    """

    path: str
    segment: int
    n_frames: int
    n_verts: int
    n_faces: int
    fps: float
    starts: tuple[int, ...]


class ReelDataset(Dataset[Window]):
    """Windows of consecutive frames of `.reel` files, decoded on demand.

    ``len(dataset)`` is the number of windows: one starts at every frame that enough frames follow.
    Sequences that are shorter than a window have none. Workers of a `DataLoader` may be forked or
    spawned; each opens the files that it needs and decodes on one core. Not thread-safe.

    Parameters
    ----------
    paths : path, or iterable of paths
        `.reel` files, addresses such as ``s3://bucket/walk.reel``, or folders, which are searched
        with their subfolders. A file with several segments is one sequence for each.
    window : int, default 1
        Frames of a window, W.
    step : int, default 1
        Distance of its frames: 2 = every other frame.
    tracks : iterable of str, default none
        Names of tracks to return; each sequence must have them.
    dtype : torch dtype, default torch.float32
        Type of positions and of real tracks, such as torch.float16. Halves have three digits:
        normalize positions.
    normalize : bool, default False
        Return positions relative to the center of the sequence's bounding box, in diagonals of it.
    memory : float or str, default "2GiB"
        Memory of each worker for decoded blocks, in bytes or such as "500MB".

    Attributes
    ----------
    sequences : tuple of SequenceEntry

    Raises
    ------
    InvalidInputError
        If there are no files or no windows, a sequence lacks a track, or an option is invalid.
    MeshReelError
        If a file cannot be opened; as `meshreel.open`.
    """

    def __init__(
        self,
        paths: str | os.PathLike[str] | Iterable[str | os.PathLike[str]],
        window: int = 1,
        *,
        step: int = 1,
        tracks: Iterable[str] = (),
        dtype: "torch.dtype" = torch.float32,
        normalize: bool = False,
        memory: float | str = "2GiB",
    ) -> None:
        _require_integers(1, window=window, step=step)
        if not isinstance(dtype, torch.dtype) or not dtype.is_floating_point:
            raise InvalidInputError(
                f"dtype must be a real type of PyTorch, such as torch.float16; got {dtype!r}"
            )
        self.window: int = window
        self.step: int = step
        self.tracks: tuple[str, ...] = tuple(tracks)
        self.dtype: torch.dtype = dtype
        self.normalize: bool = normalize
        self._memory, self._cache = bytes_of(memory, "memory"), cast("_Cache | None", None)
        self.sequences: tuple[SequenceEntry, ...] = tuple(_sequences(paths, self.tracks))
        self._ends = np.cumsum([self.n_windows(sequence) for sequence in self.sequences])
        if not len(self):
            raise InvalidInputError(
                f"no sequence has the {self.span} frames of a window; the longest has "
                f"{max(sequence.n_frames for sequence in self.sequences)}"
            )

    @property
    def span(self) -> int:
        """Number of frames from the first of a window to the last."""
        return (self.window - 1) * self.step + 1

    def n_windows(self, sequence: SequenceEntry) -> int:
        """Return the number of windows of a sequence."""
        return max(0, sequence.n_frames - self.span + 1)

    def __len__(self) -> int:
        return int(self._ends[-1])

    def __getitem__(self, index: int) -> Window:
        if not -len(self) <= index < len(self):
            raise IndexError(f"there is no window {index}; there are {len(self)}")
        return self.at(*self._locate(index))

    def __getitems__(self, indices: Sequence[int]) -> list[Window]:
        """Return several windows, as a `DataLoader` fetches them; blocks load on all cores."""
        starts = {index: self._locate(index) for index in sorted(set(indices))}
        self._load(starts.values())
        windows = {index: self.at(*start) for index, start in starts.items()}
        return [windows[index] for index in indices]

    def _locate(self, index: int) -> tuple[int, int]:
        """Return the sequence and the first frame of a window."""
        sequence = int(np.searchsorted(self._ends, index % len(self), side="right"))
        n_earlier = int(self._ends[sequence - 1]) if sequence else 0
        return sequence, index % len(self) - n_earlier

    def at(self, sequence: int, first: int) -> Window:
        """Return the window of a sequence that starts with frame `first`.

        Raises
        ------
        IndexError
            If the sequence or a frame does not exist.
        CorruptStreamError
            If a block is damaged.
        MemoryLimitError
            If decoding takes more than 2 GiB.
        """
        n_windows = self.n_windows(self.sequences[sequence])
        if not 0 <= first < n_windows:
            raise IndexError(f"no window starts with frame {first}; the sequence has {n_windows}")
        frames = range(first, first + self.span, self.step)
        vertices, *values = (self._decode(sequence, name, frames) for name in ("", *self.tracks))
        tracks = dict(zip(self.tracks, values, strict=True))
        return Window(vertices, tracks, sequence, torch.tensor(frames))

    def faces(self, sequence: int) -> "torch.Tensor":
        """Return the vertices of each triangle of a sequence, of shape (M, 3), as int64."""
        reel = self._open().get((sequence, 0), partial(self._reel, sequence))
        return torch.from_numpy(reel.faces.astype(np.int64))

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_cache": None}

    def _load(self, starts: Iterable[tuple[int, int]]) -> None:
        """Load the blocks in which these windows begin, unless they are cached."""
        cache = self._open()
        keys = dict.fromkeys((sequence, self._block(sequence, first)) for sequence, first in starts)
        missing = [key for key in keys if key not in cache]

        def load(key: Key) -> None:
            try:
                reels[key] = self._load_block(*key)
            except Exception as error:  # raised below, when no thread opens a file any more
                errors.append(error)

        for start in range(0, len(missing), n_cores()):  # few at a time, to bound the memory
            reels: dict[Key, ReelFile] = {}
            errors: list[Exception] = []
            in_threads(load, missing[start : start + n_cores()])
            for key, entry in reels.items():
                cache.put(key, entry)
            for error in errors:
                raise error

    def _decode(self, sequence: int, name: str, frames: range) -> "torch.Tensor":
        """Return positions (name "") or values of a track at some frames, of shape (W, N, C)."""
        # A file holds two blocks at a time; opened once for each, all of them can be cached.
        key = sequence, self._block(sequence, frames[0])
        reel = self._open().get(key, partial(self._reel, sequence))
        if name:
            values = reel.track(name).frames(frames)
        else:
            values = reel.frames(frames)
            if self.normalize:
                values -= np.asarray(reel.frame.origin, values.dtype)
                values /= values.dtype.type(reel.frame.scale)
        tensor = torch.from_numpy(values)
        return tensor.to(self.dtype) if tensor.is_floating_point() else tensor

    def _block(self, sequence: int, frame: int) -> int:
        """Return the block that contains a frame of a sequence."""
        return bisect(self.sequences[sequence].starts, frame) - 1

    def _has_room(self) -> bool:
        """Whether the memory holds one more block, as large as the largest so far."""
        return self._open().has_room()

    def _release(self, sequence: int, frame: int) -> None:
        """Close the block that contains a frame."""
        self._open().close((sequence, self._block(sequence, frame)))

    def _load_block(self, sequence: int, block: int) -> ReelFile:
        with ExitStack() as on_error:
            reel = on_error.enter_context(self._reel(sequence))
            reel.load(block)
            on_error.pop_all()
        return reel

    def _reel(self, sequence: int) -> ReelFile:
        entry = self.sequences[sequence]
        return open_reel(entry.path, segment=entry.segment)

    def _open(self) -> "_Cache":
        """Return the cache of this process."""
        if self._cache is None or self._cache.process != os.getpid():
            if get_worker_info() is not None:
                limit_cores(torch.get_num_threads())
            self._cache = _Cache(self._memory)
        return self._cache


class ReelStream(IterableDataset[Window]):
    """All windows of a dataset in random order, each once; blocks are decoded once.

    A window is drawn from a random block of those that are open, at most `open_blocks` and as many
    as the memory of the dataset holds. A block without further windows is closed, and the next of a
    random order is opened. A window at the end of a block decodes the next block too. Workers of a
    `DataLoader` share the work; all ranks get equally many windows, so that a few (fewer than
    `world_size`) are omitted.

    Parameters
    ----------
    dataset : ReelDataset
    open_blocks : int, default 16
    seed : int, optional
        Determines the order, together with the epoch. Default: random, from PyTorch's generator.
    rank, world_size : int, default 0 and 1
        Number of this process and of all processes of distributed training, which need a `seed`.

    Raises
    ------
    InvalidInputError
        If an option is invalid.
    """

    def __init__(
        self,
        dataset: ReelDataset,
        *,
        open_blocks: int = 16,
        seed: int | None = None,
        rank: int = 0,
        world_size: int = 1,
    ) -> None:
        _require_integers(1, open_blocks=open_blocks, world_size=world_size)
        _require_integers(0, rank=rank)
        if not rank < world_size:
            raise InvalidInputError(f"rank must be in 0..{world_size - 1}; got {rank}")
        if seed is None and world_size > 1:
            raise InvalidInputError("several ranks need the same order: set seed")
        self.dataset: ReelDataset = dataset
        self.open_blocks: int = open_blocks
        self.seed: int | None = seed
        self.rank: int = rank
        self.world_size: int = world_size
        self._epoch = torch.zeros((), dtype=torch.int64).share_memory_()  # with workers
        self._blocks = [
            (number, range(start, min(stop, dataset.n_windows(sequence))))
            for number, sequence in enumerate(dataset.sequences)
            for start, stop in pairwise(sequence.starts)
            if start < dataset.n_windows(sequence)
        ]

    def set_epoch(self, epoch: int) -> None:
        """Set the number of the epoch, which changes the order if there is a `seed`."""
        self._epoch.fill_(epoch)

    def __len__(self) -> int:
        return len(self.dataset) // self.world_size

    def __iter__(self) -> Iterator[Window]:
        worker = get_worker_info()
        number, n_workers = (worker.id, worker.num_workers) if worker else (0, 1)
        seed = self.seed
        if seed is None:  # equal in all workers
            seed = (
                worker.seed - worker.id
                if worker
                else int(torch.empty((), dtype=torch.int64).random_())
            )
        rng = np.random.default_rng([seed, int(self._epoch)])
        blocks = [self._blocks[i] for i in rng.permutation(len(self._blocks))]
        first = self.rank * len(self)
        start, stop = (first + len(self) * i // n_workers for i in (number, number + 1))
        return self._shuffled(_window_range(blocks, start, stop), rng)

    def _shuffled(
        self, blocks: Iterator[tuple[int, range]], rng: np.random.Generator
    ) -> Iterator[Window]:
        opened: list[tuple[int, list[int]]] = []
        next_block = next(blocks, None)
        while opened or next_block:
            may_open = not opened or (len(opened) < self.open_blocks and self.dataset._has_room())
            if next_block and may_open:
                sequence, windows = next_block
                opened.append((sequence, rng.permutation(windows).tolist()))
                next_block = next(blocks, None)
                block_index = len(opened) - 1  # decoded now, so that its memory counts
            else:
                block_index = int(rng.integers(len(opened)))
            sequence, first_frames = opened[block_index]
            first = first_frames.pop()
            yield self.dataset.at(sequence, first)
            if not first_frames:
                del opened[block_index]
                self.dataset._release(sequence, first)


def _window_range(
    blocks: Iterable[tuple[int, range]], start: int, stop: int
) -> Iterator[tuple[int, range]]:
    """Yield windows start..stop - 1 of all windows of the blocks in order."""
    for sequence, windows in blocks:
        part = windows[max(start, 0) : max(stop, 0)]
        if part:
            yield sequence, part
        start, stop = start - len(windows), stop - len(windows)


def collate(windows: Sequence[Window]) -> Batch:
    """Stack windows; zeros fill vertices and items that smaller meshes do not have."""
    names = windows[0].tracks
    return Batch(
        _stack_padded([window.vertices for window in windows]),
        {name: _stack_padded([window.tracks[name] for window in windows]) for name in names},
        torch.tensor([window.sequence for window in windows]),
        torch.stack([window.frames for window in windows]),
        torch.tensor([window.vertices.shape[1] for window in windows]),
    )


def _stack_padded(values: "Sequence[torch.Tensor]") -> "torch.Tensor":
    n_items = max(value.shape[1] for value in values)
    n_frames, _, n_columns = values[0].shape
    dtype = reduce(torch.promote_types, [value.dtype for value in values])
    result = torch.empty((len(values), n_frames, n_items, n_columns), dtype=dtype)
    for row, value in zip(result, values, strict=True):
        row[:, : value.shape[1]] = value
        row[:, value.shape[1] :] = 0
    return result


class _Cache:
    """Least-recently-used cache of the open files of one process."""

    def __init__(self, limit_bytes: float) -> None:
        self.process = os.getpid()
        self._limit = limit_bytes
        self._entries: OrderedDict[Key, ReelFile] = OrderedDict()
        finalize(self, _close_all, self._entries)

    def __contains__(self, key: Key) -> bool:
        return key in self._entries

    def get(self, key: Key, make: Callable[[], ReelFile]) -> ReelFile:
        """Return the entry of this key; make it if it is missing."""
        if key not in self._entries:
            self.put(key, make())
        self._entries.move_to_end(key)
        return self._entries[key]

    def put(self, key: Key, entry: ReelFile) -> None:
        """Add an entry, and close the oldest ones beyond the limits."""
        self._entries[key] = entry
        while len(self._entries) > 1 and (
            sum(self._sizes()) > self._limit or len(self._entries) > MAX_OPEN
        ):
            self._entries.popitem(last=False)[1].close()

    def has_room(self) -> bool:
        """Whether an entry as large as the largest fits."""
        sizes = self._sizes()
        return sum(sizes) + max(sizes, default=0) <= self._limit and len(sizes) < MAX_OPEN

    def close(self, key: Key) -> None:
        """Close an entry, if it exists."""
        if key in self._entries:
            self._entries.pop(key).close()

    def _sizes(self) -> list[int]:
        return [entry.cached_bytes for entry in self._entries.values()]


def _close_all(entries: OrderedDict[Key, ReelFile]) -> None:
    for entry in entries.values():
        entry.close()


def _require_integers(least: int, **options: object) -> None:
    """Raise InvalidInputError unless the options are integers, at least `least`."""
    for name, value in options.items():
        if not isinstance(value, int | np.integer) or value < least:
            raise InvalidInputError(f"{name} must be an integer, at least {least}; got {value!r}")


def _sequences(
    paths: str | os.PathLike[str] | Iterable[str | os.PathLike[str]], tracks: Sequence[str]
) -> Iterator[SequenceEntry]:
    """Yield the segments of all files; raises InvalidInputError if there are none."""
    inputs = [paths] if isinstance(paths, str | os.PathLike) else paths
    if not isinstance(inputs, Iterable):
        raise InvalidInputError(f"paths takes a path, or several; got {inputs!r}")
    inputs = [os.fspath(path) if isinstance(path, os.PathLike) else path for path in inputs]
    if not all(isinstance(path, str) for path in inputs):
        raise InvalidInputError(f"paths takes paths as strings or pathlib.Path; got {inputs!r}")
    files = [file for path in inputs for file in _files(path)]
    if not files:
        raise InvalidInputError(
            f"there is no .reel file in {', '.join(map(repr, inputs)) or 'an empty list of paths'}"
        )
    for path in files:
        with open_reel(path) as file:
            for number, reel in enumerate(file.segments):
                for name in tracks:
                    reel.track(name)
                yield SequenceEntry(
                    path,
                    number,
                    reel.n_frames,
                    reel.n_verts,
                    reel.n_faces,
                    reel.fps,
                    reel.block_starts,
                )


def _files(path: str | os.PathLike[str]) -> list[str]:
    """Return the files of a folder, sorted, or the path."""
    if is_remote(path) or not Path(path).is_dir():
        return [str(path)]
    return sorted(str(file) for file in Path(path).rglob("*.reel"))
