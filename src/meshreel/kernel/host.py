"""Callbacks that give memory and the bytes of a file to the core's decoder.

`core/include/meshreel.h` describes them (`meshreel_host`, `meshreel_source`).
"""

import ctypes
import io
import os
import threading
from collections.abc import Callable
from typing import BinaryIO

from meshreel.errors import TruncatedStreamError
from meshreel.runtime.threads import fork_safe_lock

_U32, _U64, _SIZE = ctypes.c_uint32, ctypes.c_uint64, ctypes.c_size_t
_POINTER = ctypes.c_void_p
READ = ctypes.CFUNCTYPE(ctypes.c_int, _POINTER, _U64, _POINTER, _SIZE)
ANNOUNCE = ctypes.CFUNCTYPE(ctypes.c_int, _POINTER, _U64, _U64)
RUN = ctypes.CFUNCTYPE(None, _POINTER, _POINTER, _POINTER, _U32)
TASK = ctypes.CFUNCTYPE(None, _POINTER, _U32)


class HostMemory(ctypes.Structure):
    """`reel_host_memory`: memory that the core holds for a file; threads may share it."""

    _fields_ = [("allocate", _POINTER), ("release", _POINTER), ("n_bytes", _U64)]


ALLOCATOR = tuple(
    ctypes.cast(function, _POINTER)
    for function in (ctypes.pythonapi.PyMem_RawMalloc, ctypes.pythonapi.PyMem_RawFree)
)
"""An allocator of the interpreter that does not need its lock, for `HostMemory`."""


class SourceReader:
    """Reads bytes of a seekable file for the core; threads and forked children may share it.

    All processes that inherit a file share its position, and its buffer has a lock that a child may
    inherit in the locked state. Therefore each read of a plain file passes its position to the
    system.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        is_plain = isinstance(file, io.FileIO | io.BufferedReader) and isinstance(
            getattr(file, "raw", file), io.FileIO
        )
        self._has_position = not is_plain or not hasattr(os, "pread")
        self._fetch: Callable[[int, int], None] | None = getattr(file, "fetch", None)
        self._lock = fork_safe_lock()
        self.start: int = 0
        """Byte of the file at which offsets of the core begin."""
        self._failures: dict[int, BaseException] = {}

    def bytes_at(self, offset: int, size: int) -> bytes:
        """Bytes of the file, fewer at its end."""
        if self._has_position:
            with self._lock:
                self._file.seek(offset)
                return self._file.read(size)
        data = b""
        while part := os.pread(self._file.fileno(), size - len(data), offset + len(data)):
            data += part
        return data

    def failure(self) -> BaseException | None:
        """Return and clear the last exception of the file in this thread."""
        return self._failures.pop(threading.get_ident(), None)

    def read(self, _: int | None, offset: int, address: int, size: int) -> int:
        """Callback `read`: copy bytes of the file to an address; return 0, or 1 on failure."""
        try:
            data = self.bytes_at(self.start + offset, size)
        except BaseException as error:  # raised again by the call of the core that failed
            return self._fail(error)
        if len(data) != size:
            end = f"at byte {offset + len(data)}" if data else f"before byte {offset + 1}"
            return self._fail(
                TruncatedStreamError(f"the file ended {end}; it was longer when opened")
            )
        ctypes.memmove(address, data, size)
        return 0

    def announce(self, _: int | None, offset: int, size: int) -> int:
        """Callback `announce`: fetch bytes that will be read; return 0, or 1 on failure."""
        try:
            if self._fetch is not None:
                with self._lock:
                    self._fetch(self.start + offset, self.start + offset + size)
        except BaseException as error:
            return self._fail(error)
        return 0

    def _fail(self, error: BaseException) -> int:
        self._failures[threading.get_ident()] = error
        return 1
