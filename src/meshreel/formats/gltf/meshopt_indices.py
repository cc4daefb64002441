"""Decoding vertex indices that are compressed with meshoptimizer: triangles and sequences."""

from typing import Any, Generic, TypeVar

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError

Item = TypeVar("Item")

TRIANGLES_HEAD, INDICES_HEAD = 0xE1, 0xD1
TRIANGLES_TAIL, INDICES_TAIL = 16, 4
MISSING = -1
"""Placeholder for entries of a FIFO that have not been set."""


def decode_triangles(data: bytes, count: int) -> npt.NDArray[np.uint32]:
    """Return the decoded vertex indices of a triangle list, of shape (count,).

    Raises
    ------
    FormatError
        If the data are damaged.
    """
    n_triangles, tail = count // 3, len(data) - TRIANGLES_TAIL
    if tail < 1 + n_triangles or data[0] != TRIANGLES_HEAD:
        raise FormatError("does not contain the declared triangles of version 1")
    explicit = _IndexReader(data, 1 + n_triangles, tail)
    edges, recent = _Fifo((MISSING, MISSING)), _Fifo(MISSING)
    next_vertex = 0  # the first vertex that no triangle has used
    indices: list[int] = []
    for code in data[1 : 1 + n_triangles]:
        high, low = code >> 4, code & 15
        if high < 15:  # shares edge `high` of the FIFO
            a, b = edges[high]
            if 0 < low < 13:
                c = recent[low]
            else:
                if low == 0:
                    c, next_vertex = next_vertex, next_vertex + 1
                else:
                    c = explicit.next() if low == 15 else explicit.offset_by(-1 if low == 13 else 1)
                recent.push(c)
        else:  # shares no edge
            choice = explicit.byte() if low >= 14 else data[tail + low]
            if low >= 14 and choice == 0:
                next_vertex = 0
            corners, not_in_fifo = [], []
            for kind in (15 if low == 15 else 0, choice >> 4, choice & 15):
                if kind == 0:
                    corner, next_vertex = next_vertex, next_vertex + 1
                else:
                    corner = explicit.next() if kind == 15 else recent[kind - 1]
                corners.append(corner)
                not_in_fifo += [corner] if kind in (0, 15) else []
            a, b, c = corners
            edges.push((b, a))
            for corner in not_in_fifo:
                recent.push(corner)
        edges.push((c, b))
        edges.push((a, c))
        indices += (a, b, c)
    explicit.finish()
    if indices and min(indices) < 0:
        raise FormatError("refers to a missing edge or vertex")
    return np.array(indices, np.int64).astype(np.uint32)


def decode_indices(data: bytes, count: int) -> npt.NDArray[np.uint32]:
    """Return the decoded vertex indices of a sequence, of shape (count,).

    Raises
    ------
    FormatError
        If the data are damaged.
    """
    stored = np.frombuffer(data, np.uint8)
    ends = np.flatnonzero(stored[1:-INDICES_TAIL] < 128) + 1
    if len(data) <= INDICES_TAIL or data[0] != INDICES_HEAD or len(ends) != count:
        raise FormatError("does not contain the declared indices of version 1")
    starts = np.concatenate([[1], ends[:-1] + 1])[:count]
    if count and (ends[-1] + 1 != len(data) - INDICES_TAIL or (ends - starts > 4).any()):
        raise FormatError("has an index of more than five bytes, or bytes after the last")
    codes = np.zeros(count, np.uint64)
    for byte in range(5):
        is_present = starts + byte <= ends
        bits = stored[(starts + byte)[is_present]].astype(np.uint64) & np.uint64(127)
        codes[is_present] |= bits << np.uint64(7 * byte)
    indices = np.zeros(count, np.uint32)
    short = codes.astype(np.uint32)
    for baseline in (0, 1):  # each index is a difference from the last one of its baseline
        is_selected = (short & np.uint32(1)) == baseline
        steps = decode_zigzag(short[is_selected] >> np.uint32(1))
        indices[is_selected] = np.add.accumulate(steps, dtype=np.uint32)
    return indices


def decode_zigzag(codes: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return decoded zigzag integers: 0, 1, 2, 3 become 0, -1, 1, -2, in two's complement."""
    halves = codes >> codes.dtype.type(1)
    decoded: npt.NDArray[Any] = np.where(codes & codes.dtype.type(1), ~halves, halves)
    return decoded


class _Fifo(Generic[Item]):
    """The last 16 edges or vertices; index 0 is the latest."""

    def __init__(self, missing: Item) -> None:
        self._items, self._n_pushed = [missing] * 16, 0

    def __getitem__(self, number: int) -> Item:
        return self._items[(self._n_pushed - 1 - number) & 15]

    def push(self, item: Item) -> None:
        """Add an item."""
        self._items[self._n_pushed & 15] = item
        self._n_pushed += 1


class _IndexReader:
    """Reader of the explicit indices in a triangle stream."""

    def __init__(self, data: bytes, start: int, end: int) -> None:
        self._data, self._offset, self._end = data, start, end
        self._last = 0

    def byte(self) -> int:
        """Return the next byte."""
        if self._offset >= self._end:
            raise FormatError("ends before its last triangle")
        self._offset += 1
        return self._data[self._offset - 1]

    def next(self) -> int:
        """Return the next index, stored as a difference of up to five bytes."""
        code = shift = 0
        while (byte := self.byte()) >= 128:
            code |= (byte & 127) << shift
            shift += 7
            if shift > 28:
                raise FormatError("has an index of more than five bytes")
        code = (code | byte << shift) & 0xFFFFFFFF
        return self.offset_by(~(code >> 1) if code & 1 else code >> 1)

    def offset_by(self, difference: int) -> int:
        """Return the last index plus a difference, as the new last index."""
        self._last = (self._last + difference) & 0xFFFFFFFF
        return self._last

    def finish(self) -> None:
        """Check that all bytes have been read."""
        if self._offset != self._end:
            raise FormatError(f"has {self._end - self._offset} bytes after its last triangle")
