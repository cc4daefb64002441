"""Remote files read by byte ranges."""

import io
import os
import re
from collections import OrderedDict
from typing import Any, BinaryIO, cast

from meshreel.errors import StoreError
from meshreel.runtime.stores.address import is_web
from meshreel.runtime.stores.filesystem import errors_in_words, filesystem_of
from meshreel.runtime.stores.transfer import receive, web_answer

END_BYTES = 1 << 14
"""Size of the start and of the end that opening a file fetches: header, index, end marker."""

MIN_REQUEST_BYTES = 1 << 10
"""Minimum size of a request for a read without a preceding `fetch`."""

CACHE_BYTES = 1 << 26
"""Size of the cache of recently used ranges."""

_PARTIAL = 206
"""Status of an answer with a range."""


class RangedFile(io.RawIOBase):
    """A seekable remote file, which requests each range that is not in its cache.

    Attributes
    ----------
    size_bytes : int
    n_requests : int
        Number of requests so far.
    fetched_bytes : int
        Size of their answers.

    Raises
    ------
    StoreError
        If the file does not exist or cannot be reached, or its server does not support ranges.
    """

    def __init__(self, address: str) -> None:
        super().__init__()
        self.address = address
        self.n_requests: int = 0
        self.fetched_bytes: int = 0
        self._cache: OrderedDict[tuple[int, int], bytes] = OrderedDict()
        self._position = 0
        self._file: Any = None
        with errors_in_words(address):
            self._connect()
            self.size_bytes: int = self._size()
        self.fetch(0, END_BYTES)
        self.fetch(self.size_bytes - END_BYTES, self.size_bytes)

    def fetch(self, start: int, stop: int) -> None:
        """Cache the bytes start..stop - 1, with one request if any of them are missing."""
        start, stop = max(0, start), min(stop, self.size_bytes)
        if start >= stop or self._cached_range(start, stop) is not None:
            return
        data = self._request(start, stop)
        self._cache[start, start + len(data)] = data
        while len(self._cache) > 1 and sum(map(len, self._cache.values())) > CACHE_BYTES:
            self._cache.popitem(last=False)

    def readable(self) -> bool:
        """Return True."""
        return True

    def seekable(self) -> bool:
        """Return True."""
        return True

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Move to a byte, without a request."""
        origin = {os.SEEK_SET: 0, os.SEEK_CUR: self._position, os.SEEK_END: self.size_bytes}
        self._position = max(0, origin[whence] + offset)
        return self._position

    def tell(self) -> int:
        """Return the position of the next read."""
        return self._position

    def read(self, size: int = -1) -> bytes:
        """Return `size` bytes, fewer only at the end of the file; by default all up to the end."""
        start = self._position
        stop = self.size_bytes if size < 0 else min(start + size, self.size_bytes)
        if start >= stop:
            return b""
        if self._cached_range(start, stop) is None:
            self.fetch(start, max(stop, start + MIN_REQUEST_BYTES))
        cached = cast("tuple[int, int]", self._cached_range(start, stop))
        self._cache.move_to_end(cached)
        self._position = stop
        return self._cache[cached][start - cached[0] : stop - cached[0]]

    def close(self) -> None:
        """Close the file and clear the cache."""
        if not self.closed:
            self._cache.clear()
            if self._file is not None:  # None if opening failed
                self._file.close()
        super().close()

    def _connect(self) -> None:
        self._filesystem, path = filesystem_of(self.address)
        self._process = os.getpid()
        self._file = self._filesystem.open(path, "rb", cache_type="none")

    def _size(self) -> int:
        size_bytes = getattr(self._file, "size", None)
        if size_bytes is not None:
            return int(size_bytes)
        try:
            return int(self._file.seek(0, os.SEEK_END))
        except ValueError:
            raise StoreError(self._no_ranges("does not report the size of the file")) from None

    def _cached_range(self, start: int, stop: int) -> tuple[int, int] | None:
        return next((span for span in self._cache if span[0] <= start and stop <= span[1]), None)

    def _request(self, start: int, stop: int) -> bytes:
        self.n_requests += 1
        with errors_in_words(self.address):
            if self._process != os.getpid():  # a forked child lacks the threads of fsspec
                self._connect()
            if is_web(self.address):
                from fsspec.asyn import sync

                data: bytes = sync(self._file.loop, self._read_web, start, stop)
            else:
                self._file.seek(start)
                data = bytes(self._file.read(stop - start))
        self.fetched_bytes += len(data)
        if len(data) != stop - start:
            raise StoreError(
                f"the answer for {self.address} was cut short: {len(data)} of {stop - start} bytes "
                f"from byte {start}; try again"
            )
        return data

    async def _read_web(self, start: int, stop: int) -> bytes:
        """Read a range from a web server; fsspec itself would accept any range, of any size."""
        received = io.BytesIO()
        span = f"bytes={start}-{stop - 1}"
        async with web_answer(self._filesystem, self._file.url, self.address, Range=span) as answer:
            # A whole file begins with the range at byte 0, and its rest is not read.
            if answer.status != _PARTIAL and start > 0:
                raise StoreError(self._no_ranges("answers with the whole file"))
            content_range = answer.headers.get("Content-Range", "")
            expected = rf"bytes {start}-\d+/({self.size_bytes}|\*)"
            if answer.status == _PARTIAL and not re.fullmatch(expected, content_range):
                raise StoreError(self._no_ranges(f"answers with the range {content_range[:60]!r}"))
            await receive(answer, stop - start, received.write, self.address)
        return received.getvalue()

    def _no_ranges(self, reason: str) -> str:
        return (
            f"the server of {self.address} does not support byte ranges ({reason}), so frames "
            "cannot be read individually; decode the whole file (meshreel.decode) or download it"
        )


def open_ranged(address: str) -> BinaryIO:
    """Open a `RangedFile`, typed as a binary file."""
    return cast("BinaryIO", RangedFile(address))
