"""Frames of positions and tracks, decoded by the core for any number of threads."""

import os
from typing import Any

import numpy.typing as npt

from meshreel.kernel.files import OpenFile, ReelDecoder
from meshreel.runtime.fork import fork_safe_lock
from meshreel.runtime.profiling import staged

Values = npt.NDArray[Any]


class FrameDecoder:
    """Decodes frames of a file of `reel`, `lossless` or `grid`; several threads may share one.

    Parameters
    ----------
    file : OpenFile
    n_modes : int, default 0
        Only the first so many modes move; 0: all.
    """

    def __init__(self, file: OpenFile, n_modes: int = 0) -> None:
        self._file, self._n_modes = file, n_modes
        self._lock = fork_safe_lock()
        self._process = os.getpid()
        self._opened: ReelDecoder | None = None

    @staged("fields")
    def load(self, block: int, track: int = 0) -> None:
        """Load a block, unless it is held; raises as `fill`."""
        with self._lock:
            self._decoder().load(track, block, self._modes(track))

    @staged("frames")
    def fill(self, out: Values, first: int, track: int = 0) -> None:
        """Fill an array of shape (n, N, C) with frames of a track from `first` on.

        Raises
        ------
        CorruptStreamError, TruncatedStreamError
            If a block is damaged.
        MemoryLimitError
            If a block takes more memory than allowed.
        """
        with self._lock:
            self._decoder().fill(out, track, first, self._modes(track))

    def close(self) -> None:
        """Release all that is held."""
        with self._lock:
            if self._opened is not None:
                self._opened.close()
            self._opened = None

    def _modes(self, track: int) -> int:
        return 0 if track else self._n_modes

    def _decoder(self) -> ReelDecoder:
        if self._opened is None or self._process != os.getpid():
            # A decoder of the parent may have been in use while this process was forked.
            self._process = os.getpid()
            self._opened = ReelDecoder(self._file)
        return self._opened
