"""What the core's decoder requires of its host: memory, threads and the bytes of the file.

`core/include/meshreel.h` describes these callbacks (`meshreel_host`, `meshreel_source`).
"""

import ctypes
import threading
from collections.abc import Callable
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from meshreel.errors import TruncatedStreamError
from meshreel.kernel.library import ALIGNMENT
from meshreel.runtime.threads import POOL, fork_safe_lock, n_cores, pool

_U32, _U64, _SIZE = ctypes.c_uint32, ctypes.c_uint64, ctypes.c_size_t
_POINTER = ctypes.c_void_p
READ = ctypes.CFUNCTYPE(ctypes.c_int, _POINTER, _U64, _POINTER, _SIZE)
ANNOUNCE = ctypes.CFUNCTYPE(ctypes.c_int, _POINTER, _U64, _U64)
ALLOCATE = ctypes.CFUNCTYPE(_POINTER, _POINTER, _SIZE)
RELEASE = ctypes.CFUNCTYPE(None, _POINTER, _POINTER, _SIZE)
RUN = ctypes.CFUNCTYPE(None, _POINTER, _POINTER, _POINTER, _U32)
TASK = ctypes.CFUNCTYPE(None, _POINTER, _U32)


MAX_UNUSED_BYTES = 64 << 20

Block = npt.NDArray[np.uint8]

_unused: dict[int, list[Block]] = {}
"""Released blocks, by size."""


class HostMemory:
    """Memory that the core holds, by its address.

    The system clears memory that is new to a process page by page, which takes a tenth of decoding.
    Up to `MAX_UNUSED_BYTES` of released blocks are therefore kept for the next ones, of any file.
    """

    def __init__(self) -> None:
        self._held: dict[int, Block] = {}
        self.n_bytes = 0

    def allocate(self, _: int | None, size: int) -> int | None:
        """Return the address of a block, or None: `allocate` of `meshreel_host`."""
        try:
            block = _block(_rounded(size) + ALIGNMENT)
        except MemoryError:
            return None
        address: int = block.__array_interface__["data"][0]
        address += -address % ALIGNMENT
        self._held[address] = block
        self.n_bytes += size
        return address

    def release(self, _: int | None, address: int, size: int) -> None:
        """Release a block: `release` of `meshreel_host`."""
        block = self._held.pop(address)
        self.n_bytes -= size
        if unused_bytes() + len(block) <= MAX_UNUSED_BYTES:
            _unused.setdefault(len(block), []).append(block)


def unused_bytes() -> int:
    """Size of the released blocks that are kept."""
    return sum(size * len(blocks) for size, blocks in list(_unused.items()))


def _block(size: int) -> Block:
    try:
        return _unused[size].pop()
    except (KeyError, IndexError):
        return np.empty(size, np.uint8)


def _rounded(size: int) -> int:
    """Round a size up to one of four per power of 2, so that blocks of similar sizes fit."""
    step = 1 << max(size.bit_length() - 3, 6)
    return -(-size // step) * step


def run_tasks(_: int | None, task: int, shared: int | None, n_tasks: int) -> None:
    """Call tasks 0..n_tasks - 1 of the core on all cores, in any order: `run` of `meshreel_host`.

    The caller takes part, so that a thread that is slow to wake up delays nothing. The tasks call
    neither BLAS nor NumPy, so BLAS keeps its threads, unlike in `in_threads`.
    """
    function, numbers = TASK(task), iter(range(n_tasks))

    def work() -> None:
        for number in numbers:  # the interpreter's lock gives each number to one thread
            function(shared, number)

    # A thread of the pool must not wait for another: all of them could wait at once.
    is_alone = threading.current_thread().name.startswith(POOL)
    n_others = 0 if is_alone else min(n_tasks, n_cores()) - 1
    others = [pool().submit(work) for _ in range(n_others)]
    try:
        work()
    finally:
        work()  # what an interrupt left: the core continues when this returns
        for other in others:
            if not other.cancel():
                other.result()


class SourceReader:
    """Reads bytes of a seekable file for the core; threads may share it."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._fetch: Callable[[int, int], None] | None = getattr(file, "fetch", None)
        self._lock = fork_safe_lock()
        self._failures: dict[int, BaseException] = {}

    def bytes_at(self, offset: int, size: int) -> bytes:
        """Bytes of the file, fewer at its end."""
        with self._lock:
            self._file.seek(offset)
            return self._file.read(size)

    def failure(self) -> BaseException | None:
        """Return and clear the last exception of the file in this thread."""
        return self._failures.pop(threading.get_ident(), None)

    def read(self, _: int | None, offset: int, to: int, size: int) -> int:
        """Copy bytes of the file to an address; return 0, or 1 if that fails: `read`."""
        try:
            data = self.bytes_at(offset, size)
        except BaseException as error:  # raised again by the call of the core that failed
            return self._fail(error)
        if len(data) != size:
            end = offset + len(data)
            return self._fail(
                TruncatedStreamError(f"the file ended at byte {end}; it was longer when opened")
            )
        ctypes.memmove(to, data, size)
        return 0

    def announce(self, _: int | None, offset: int, size: int) -> int:
        """Fetch bytes that will be read; return 0, or 1 if that fails: `announce`."""
        try:
            if self._fetch is not None:
                with self._lock:
                    self._fetch(offset, offset + size)
        except BaseException as error:
            return self._fail(error)
        return 0

    def _fail(self, error: BaseException) -> int:
        self._failures[threading.get_ident()] = error
        return 1
