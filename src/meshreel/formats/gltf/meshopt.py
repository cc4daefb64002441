"""Decoding buffer views of a glTF file that are compressed with meshoptimizer.

Implemented from the specification of `KHR_meshopt_compression`, which extends
`EXT_meshopt_compression`: https://github.com/KhronosGroup/glTF, extensions/2.0/Khronos. There are
no Python wheels of the meshoptimizer library.
"""

from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Bytes
from meshreel.errors import FormatError
from meshreel.model.rig_keys import decode_rotations

MESHOPT = "EXT_meshopt_compression"
READ_EXTENSIONS = (MESHOPT, "KHR_meshopt_compression")
"""The extension that is written, and those that are read."""

TRIANGLES_HEAD, TRIANGLES_TAIL = 0xE1, 16
FIFO_SIZE = 16
MISSING = -1
"""Placeholder for entries of a FIFO that have not been set."""

GROUP = 16
"""Elements per group, whose deltas have the same width."""
BLOCK_BYTES, MAX_BLOCK = 8192, 256
MAX_STRIDE = 256
VERSIONS = {0xA0: 0, 0xA1: 1}
WIDTHS = {0: (0, 1, 2, 4), 1: (1, 2, 4, 8)}
"""Bits per delta in the four modes of a group, by control mode of version 1."""
WIDTHS_0 = (0, 2, 4, 8)
LOWEST = {1: 0xFFFF, 2: 0x55555555, 4: 0x1111111111111111}
"""Mask of the lowest bit of each delta of a group, by bits per delta."""
ALL_ZERO, LITERAL = 2, 3
FILTER_STRIDES = {"OCTAHEDRAL": (4, 8), "QUATERNION": (8,), "COLOR": (4, 8)}


def decode_view(data: bytes, count: int, stride: int, mode: str, kind: str) -> Bytes:
    """Return the decompressed bytes of a buffer view, of shape (count * stride,).

    Parameters
    ----------
    data : bytes
        The compressed data.
    count, stride : int
        Number of elements, and bytes of each.
    mode, kind : str
        Mode and filter of the extension.
    """
    if mode == "ATTRIBUTES":
        if not 0 < stride <= MAX_STRIDE or stride % 4:
            raise FormatError(
                f"'byteStride' must be a multiple of 4 up to {MAX_STRIDE}; got {stride}"
            )
        if kind not in FILTERS or stride not in FILTER_STRIDES.get(kind, (stride,)):
            raise FormatError(
                f"'filter' must be one of {', '.join(FILTERS)}, and match its byteStride; "
                f"got {kind!r}"
            )
        return FILTERS[kind](decode_attributes(data, count, stride)).reshape(-1)
    if mode == "INDICES":
        raise FormatError("'mode' INDICES, of strips and fans, is not supported; export triangles")
    if mode != "TRIANGLES":
        raise FormatError(f"'mode' must be ATTRIBUTES or TRIANGLES; got {mode!r}")
    if stride not in (2, 4) or kind != "NONE" or count % 3:
        raise FormatError(
            "TRIANGLES must have no filter, a byteStride of 2 or 4 and a count divisible by 3; "
            f"got {kind}, {stride} and {count}"
        )
    return decode_triangles(data, count).astype("<u4").astype(f"<u{stride}").view(np.uint8)


def decode_attributes(data: bytes, count: int, stride: int) -> Bytes:
    """Return decoded elements before any filter, of shape (count, stride)."""
    version = VERSIONS.get(data[0] if data else 0)
    if version is None:
        raise FormatError("does not start with attributes of version 0 or 1")
    n_modes = stride // 4 if version else 0
    end = len(data) - max(stride + n_modes, 24 if version else 32)
    groups, literals = _scan_groups(data, end, count, stride, version)
    deltas = np.zeros((-(-count // GROUP), GROUP, stride), np.uint8)
    buffer = np.frombuffer(data, np.uint8)
    for width, locations in groups.items():
        rows = np.array(locations, np.int64).reshape(-1, 3)
        deltas[rows[:, 1], :, rows[:, 2]] = _deltas(buffer, rows[:, 0], width)
    elements = deltas.reshape(-1, stride)
    for offset, start, n_elements, channel in literals:
        elements[start : start + n_elements, channel] = buffer[offset : offset + n_elements]
    first = len(data) - stride - n_modes
    modes = data[first + stride :] if version else bytes(stride // 4)
    return _accumulate(elements[:count], buffer[first : first + stride], modes)


Groups = dict[int, list[tuple[int, int, int]]]
Literals = list[tuple[int, int, int, int]]


def _scan_groups(
    data: bytes, end: int, count: int, stride: int, version: int
) -> tuple[Groups, Literals]:
    """Return the locations of the deltas of each group.

    Returns
    -------
    groups : dict of lists
        By bits per delta: byte offset, group index, and byte within the elements.
    literals : list
        Uncompressed deltas: byte offset, first element, number of elements, and byte within the
        elements.
    """
    groups: Groups = {1: [], 2: [], 4: [], 8: []}
    literals: Literals = []
    n_block = min((BLOCK_BYTES // stride) & ~(GROUP - 1), MAX_BLOCK)
    offset = 1
    for start in range(0, count, n_block):
        n_elements = min(n_block, count - start)
        n_groups = -(-n_elements // GROUP)
        controls = data[offset : offset + stride // 4] if version else b""
        offset += len(controls)
        for channel in range(stride):
            control = 0
            if version:
                control = _byte(controls, channel // 4) >> (2 * (channel % 4)) & 3
            if control == LITERAL:
                literals.append((offset, start, n_elements, channel))
                offset += n_elements
            elif control != ALL_ZERO:
                widths = WIDTHS[control] if version else WIDTHS_0
                n_bytes = -(-n_groups // 4)
                heads, offset = data[offset : offset + n_bytes], offset + n_bytes
                for number in range(n_groups):
                    width = widths[_byte(heads, number // 4) >> (2 * (number % 4)) & 3]
                    if width:
                        groups[width].append((offset, start // GROUP + number, channel))
                        offset += 2 * width + _count_sentinels(data, offset, width)
            if offset > end:
                raise FormatError("ends before its last element")
    if offset != end:
        raise FormatError(f"has {end - offset} bytes after its last element")
    return groups, literals


def _byte(data: bytes, index: int) -> int:
    if index >= len(data):
        raise FormatError("ends before its last element")
    return data[index]


def _count_sentinels(data: bytes, offset: int, width: int) -> int:
    """Return the number of deltas of a group with all bits set, whose values follow as bytes."""
    if width == 8:
        return 0
    bits = int.from_bytes(data[offset : offset + 2 * width], "little")
    if width > 1:
        bits &= bits >> 1
    if width > 2:
        bits &= bits >> 2
    return (bits & LOWEST[width]).bit_count()


def _deltas(buffer: Bytes, offsets: npt.NDArray[np.int64], width: int) -> Bytes:
    """Return the deltas of groups at byte offsets, of shape (G, 16)."""
    rows: Bytes = buffer[offsets[:, np.newaxis] + np.arange(2 * width)]
    if width == 8:
        return rows
    bits = np.unpackbits(rows, axis=1, bitorder="little" if width == 1 else "big")
    weights = (1 << np.arange(width)[::-1]).astype(np.uint8)
    values: Bytes = (bits.reshape(len(rows), GROUP, width) * weights).sum(axis=2, dtype=np.uint8)
    is_sentinel = values == (1 << width) - 1
    value_offsets = offsets[:, np.newaxis] + 2 * width + np.cumsum(is_sentinel, axis=1) - 1
    values[is_sentinel] = buffer[value_offsets[is_sentinel]]
    return values


def _accumulate(deltas: Bytes, first: Bytes, modes: bytes) -> Bytes:
    """Return elements from their deltas to the previous element."""
    sums = np.empty_like(deltas)
    for channel, mode in enumerate(modes):
        columns = slice(4 * channel, 4 * channel + 4)
        rotation = mode >> 4
        if mode & 15 > 2 or (rotation and mode & 15 < 2):
            raise FormatError(f"has an unknown channel mode {mode}")
        dtype = ("<u1", "<u2", "<u4")[mode & 15]
        steps = np.ascontiguousarray(deltas[:, columns]).view(dtype)
        previous = np.ascontiguousarray(first[columns]).view(dtype)
        if mode & 15 == 2:
            # The encoder rotates left.
            rotated = (steps >> np.uint32(rotation)) | (steps << np.uint32((32 - rotation) & 31))
            values = np.bitwise_xor.accumulate(rotated, axis=0) ^ previous
        else:
            values = np.add.accumulate(decode_zigzag(steps), axis=0, dtype=steps.dtype) + previous
        sums[:, columns] = np.ascontiguousarray(values.astype(dtype)).view(np.uint8)
    return sums


def _octahedral(elements: Bytes) -> Bytes:
    """Decode unit vectors in octahedral encoding; the fourth component is unchanged."""
    rows = elements.view(f"<i{elements.shape[1] // 4}")
    decoded, maximum = rows.copy(), np.iinfo(rows.dtype).max
    x, y = (rows[:, :2] / np.maximum(rows[:, 2:3], 1).astype(np.float64)).T
    z = 1 - np.abs(x) - np.abs(y)
    below = np.minimum(z, 0)
    x, y = x - np.copysign(below, x), y - np.copysign(below, y)
    vectors = np.stack([x, y, z], axis=1)
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    decoded[:, :3] = _round(vectors / np.maximum(lengths, 1e-9) * maximum)
    return decoded.view(np.uint8)


def _quaternion(elements: Bytes) -> Bytes:
    """Decode unit quaternions from their three smallest components."""
    return decode_rotations(elements.view("<i2")).view(np.uint8)


def _exponential(elements: Bytes) -> Bytes:
    """Decode float32 from 8-bit exponents and 24-bit mantissas."""
    rows = elements.view("<i4")
    with np.errstate(over="ignore"):  # non-finite values are reported where they are used
        numbers = np.ldexp((rows << 8 >> 8).astype(np.float32), rows >> 24)
    floats: Bytes = numbers.astype("<f4").view(np.uint8)
    return floats


def _color(elements: Bytes) -> Bytes:
    """Decode red, green, blue and alpha from luma, two color differences, and alpha."""
    width = elements.shape[1] // 4
    unsigned, signed = (elements.view(f"<{kind}{width}").astype(np.int64) for kind in "ui")
    luma, alpha = unsigned[:, 0], unsigned[:, 3]
    orange, green = signed[:, 1], signed[:, 2]
    n_bits = np.frexp(alpha.astype(np.float64))[1]  # bits up to the highest set bit
    scale = np.maximum((1 << n_bits.astype(np.int64)) - 1, 1)
    bits = alpha & (scale >> 1)
    channels = [luma + orange - green, luma + green, luma - orange - green, bits << 1 | (bits & 1)]
    maximum = np.iinfo(f"u{width}").max
    scaled = _round(np.stack(channels, axis=1) * (maximum / scale)[:, np.newaxis])
    return np.clip(scaled, 0, maximum).astype(f"<u{width}").view(np.uint8)


def _round(values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return values rounded to integers, halves away from zero."""
    integers: npt.NDArray[np.float64] = np.trunc(values + np.copysign(0.5, values))
    return integers


FILTERS: dict[str, Callable[[Bytes], Bytes]] = {
    "NONE": lambda elements: elements,
    "OCTAHEDRAL": _octahedral,
    "QUATERNION": _quaternion,
    "EXPONENTIAL": _exponential,
    "COLOR": _color,
}


def decode_triangles(data: bytes, count: int) -> npt.NDArray[np.uint32]:
    """Return the decoded vertex indices of a triangle list, of shape (count,)."""
    n_triangles, tail = count // 3, len(data) - TRIANGLES_TAIL
    if tail < 1 + n_triangles or data[0] != TRIANGLES_HEAD:
        raise FormatError("does not contain the declared triangles of version 1")
    reader = _IndexReader(data, 1 + n_triangles, tail)
    edges = deque([(MISSING, MISSING)] * FIFO_SIZE, FIFO_SIZE)  # the latest first
    recent_vertices = deque([MISSING] * FIFO_SIZE, FIFO_SIZE)
    next_vertex = 0  # the first vertex that no triangle has used
    indices: list[int] = []
    for code in data[1 : 1 + n_triangles]:
        high, low = code >> 4, code & 15
        if high < 15:  # shares edge `high` of the FIFO
            a, b = edges[high]
            if 0 < low < 13:
                c = recent_vertices[low]
            else:
                if low == 0:
                    c, next_vertex = next_vertex, next_vertex + 1
                else:
                    c = reader.next() if low == 15 else reader.offset_by(-1 if low == 13 else 1)
                recent_vertices.appendleft(c)
        else:  # shares no edge
            corner_kinds = reader.byte() if low >= 14 else data[tail + low]
            if low >= 14 and corner_kinds == 0:
                next_vertex = 0
            corners, not_in_fifo = [], []
            for kind in (15 if low == 15 else 0, corner_kinds >> 4, corner_kinds & 15):
                if kind == 0:
                    corner, next_vertex = next_vertex, next_vertex + 1
                else:
                    corner = reader.next() if kind == 15 else recent_vertices[kind - 1]
                corners.append(corner)
                not_in_fifo += [corner] if kind in (0, 15) else []
            a, b, c = corners
            edges.appendleft((b, a))
            for corner in not_in_fifo:
                recent_vertices.appendleft(corner)
        edges.appendleft((c, b))
        edges.appendleft((a, c))
        indices += (a, b, c)
    reader.finish()
    if indices and min(indices) < 0:
        raise FormatError("refers to a missing edge or vertex")
    return np.array(indices, np.int64).astype(np.uint32)


def decode_zigzag(codes: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return decoded zigzag integers: 0, 1, 2, 3 become 0, -1, 1, -2, in two's complement."""
    halves = codes >> codes.dtype.type(1)
    decoded: npt.NDArray[Any] = np.where(codes & codes.dtype.type(1), ~halves, halves)
    return decoded


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
