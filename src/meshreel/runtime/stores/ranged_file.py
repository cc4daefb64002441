"""A remote file of which only the bytes are fetched that are read."""

import io
import os
from collections import OrderedDict
from typing import Any, BinaryIO, cast

from meshreel.errors import StoreError
from meshreel.runtime.stores.filesystem import errors_in_words, filesystem_of

END_BYTES = 1 << 14
"""Of the beginning and of the end, fetched when the file is opened: header, index, end marker."""

LEAST_BYTES = 1 << 10
"""Fetched for a read that nobody announced."""

KEPT_BYTES = 1 << 26
"""Of ranges that stay in memory, the last ones used."""


class RangedFile(io.RawIOBase):
    """A remote file to read and to seek in; each range that it lacks is one request.

    Attributes
    ----------
    size_bytes : int
    n_requests : int
        For ranges, so far.
    fetched_bytes : int
        Of their answers.

    Raises
    ------
    StoreError
        If there is no such file, it cannot be reached, or its server gives no ranges.
    """

    def __init__(self, address: str) -> None:
        super().__init__()
        self.address = address
        self.n_requests = self.fetched_bytes = 0
        self._kept: OrderedDict[tuple[int, int], bytes] = OrderedDict()
        self._position = 0
        self._file: Any = None
        with errors_in_words(address):
            self._connect()
            self.size_bytes = self._size()
        self.fetch(0, END_BYTES)
        self.fetch(self.size_bytes - END_BYTES, self.size_bytes)

    def fetch(self, start: int, stop: int) -> None:
        """Have the bytes start..stop - 1 at hand, with one request if some of them are missing."""
        start, stop = max(0, start), min(stop, self.size_bytes)
        if start < stop and self._covering(start, stop) is None:
            self._keep(start, self._requested(start, stop))

    def readable(self) -> bool:
        """Yes."""
        return True

    def seekable(self) -> bool:
        """Yes."""
        return True

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Go to a byte; nothing is fetched."""
        origin = {os.SEEK_SET: 0, os.SEEK_CUR: self._position, os.SEEK_END: self.size_bytes}
        self._position = max(0, origin[whence] + offset)
        return self._position

    def tell(self) -> int:
        """The byte that is read next."""
        return self._position

    def read(self, size: int = -1) -> bytes:
        """So many bytes, or all that follow."""
        start = self._position
        stop = self.size_bytes if size < 0 else min(start + size, self.size_bytes)
        if start >= stop:
            return b""
        if self._covering(start, stop) is None:
            self.fetch(start, max(stop, start + LEAST_BYTES))
        found = cast("tuple[int, int]", self._covering(start, stop))
        self._kept.move_to_end(found)
        self._position = stop
        return self._kept[found][start - found[0] : stop - found[0]]

    def close(self) -> None:
        """Forget all that was fetched."""
        if not self.closed:
            self._kept.clear()
            if self._file is not None:  # of an address that could not be opened
                self._file.close()
        super().close()

    def _connect(self) -> None:
        filesystem, path = filesystem_of(self.address)
        self._process = os.getpid()
        self._file = filesystem.open(path, "rb", cache_type="none")

    def _size(self) -> int:
        size_bytes = getattr(self._file, "size", None)
        if size_bytes is not None:
            return int(size_bytes)
        try:
            return int(self._file.seek(0, os.SEEK_END))
        except ValueError:
            why = "does not say how long the file is"
            raise StoreError(self._no_ranges(why)) from None

    def _covering(self, start: int, stop: int) -> tuple[int, int] | None:
        return next((one for one in self._kept if one[0] <= start and stop <= one[1]), None)

    def _requested(self, start: int, stop: int) -> bytes:
        self.n_requests += 1
        try:
            with errors_in_words(self.address):
                if self._process != os.getpid():  # a forked child has no threads of fsspec
                    self._connect()
                self._file.seek(start)
                data = bytes(self._file.read(stop - start))
        except StoreError as error:
            if isinstance(error.__cause__, ValueError):  # of fsspec, where all comes at once
                raise StoreError(self._no_ranges("answers with the whole file")) from None
            raise
        self.fetched_bytes += len(data)
        if len(data) != stop - start:
            raise StoreError(
                f"the answer for {self.address} was cut short: {len(data)} of {stop - start} bytes "
                f"from byte {start} on; try again"
            )
        return data

    def _keep(self, start: int, data: bytes) -> None:
        self._kept[start, start + len(data)] = data
        while len(self._kept) > 1 and sum(map(len, self._kept.values())) > KEPT_BYTES:
            self._kept.popitem(last=False)

    def _no_ranges(self, why: str) -> str:
        return (
            f"the server of {self.address} gives no ranges of bytes ({why}), so that frames cannot "
            "be taken one by one; load or decode all of it (meshreel.decode), or download it first"
        )


def open_ranged(address: str) -> BinaryIO:
    """A `RangedFile`, as the type that readers of files take."""
    return cast("BinaryIO", RangedFile(address))
