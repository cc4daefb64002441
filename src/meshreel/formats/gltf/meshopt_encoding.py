"""Encoding of buffer views of a glTF file as the decoder of meshoptimizer expects.

Implemented from the specification of `EXT_meshopt_compression`: https://github.com/KhronosGroup/glTF,
extensions/2.0/Vendor. It allows version 0 of attributes only.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Bytes
from meshreel.formats.gltf.meshopt import (
    BLOCK_BYTES,
    FIFO_SIZE,
    GROUP,
    MAX_BLOCK,
    TRIANGLES_HEAD,
    TRIANGLES_TAIL,
    WIDTHS_0,
)

ATTRIBUTES_HEAD, ATTRIBUTES_TAIL = 0xA0, 32
QUAD_WEIGHTS = np.array([1, 4, 16, 64], np.uint8)
"""Weights of four numbers of two bits in a byte."""
PIECE_BLOCKS = 128
"""Blocks that are encoded together, to limit memory."""
IMPOSSIBLE = 1 << 20
"""Size of codings that would lose deltas."""

NEXT, EXPLICIT = 0, 15
"""Nibbles of the next unused vertex, and of an index that is stored explicitly."""
ALL_NEXT, FIRST_NEXT, FIRST_EXPLICIT = 0xF0, 0xFE, 0xFF
"""Codes of triangles without shared edge: `ALL_NEXT` with a lookup table of zeros."""
MAX_EDGE, MAX_THIRD, MAX_CORNER = 14, 12, 13
"""Largest positions in a FIFO of a shared edge, of the corner opposite to it, and of other corners
to which a nibble can refer."""
MAX_MANTISSA, MAX_EXPONENT = (1 << 23) - 1, 100


def encode_view(elements: npt.NDArray[Any], mode: str) -> tuple[bytes, str]:
    """Return the compressed bytes of a buffer view, and the filter that they need.

    Parameters
    ----------
    elements : array of shape (N, C)
        Values of a type with a fixed byte order. Of attributes, each row has a multiple of 4 bytes
        up to 256; of triangles, there are three corners with C = 1 for each.
    mode : str
        "ATTRIBUTES" or "TRIANGLES".
    """
    if mode == "TRIANGLES":
        return encode_triangles(elements.reshape(-1, 3)), "NONE"
    rows = np.ascontiguousarray(elements)
    streams = [(encode_attributes(rows.view(np.uint8)), "NONE")]
    if rows.dtype == np.float32 and (exponential := encode_exponential(rows)) is not None:
        streams.append((encode_attributes(exponential), "EXPONENTIAL"))
    return min(streams, key=lambda stream: len(stream[0]))


def encode_exponential(values: npt.NDArray[np.float32]) -> Bytes | None:
    """Return the bytes that the exponential filter decodes to float32 values of shape (N, C).

    All values have the same exponent; None if the mantissas of 24 bits do not suffice for that.
    """
    mantissas, exponents = np.frexp(values[values != 0].astype(np.float64))
    significands = (mantissas * (1 << 24)).astype(np.int64)
    lowest_bits = np.frexp((significands & -significands).astype(np.float64))[1] - 1
    exponent = int((exponents - 24 + lowest_bits).min(initial=MAX_EXPONENT))
    integers = np.ldexp(values.astype(np.float64), -exponent)
    if abs(exponent) > MAX_EXPONENT or np.abs(integers).max() > MAX_MANTISSA:
        return None
    words = (exponent << 24) | (integers.astype(np.int64) & 0xFFFFFF)
    return words.astype(np.uint32).astype("<u4").view(np.uint8)


def encode_attributes(elements: Bytes) -> bytes:
    """Return compressed elements.

    Parameters
    ----------
    elements : uint8 array of shape (N, stride)
        N at least 1; the stride is a multiple of 4 up to 256.
    """
    count, stride = elements.shape
    deltas = np.zeros_like(elements)
    deltas[1:] = encode_zigzag(np.diff(elements, axis=0))
    n_block = min(BLOCK_BYTES // stride, MAX_BLOCK) // GROUP * GROUP
    n_piece = n_block * PIECE_BLOCKS
    blocks = [
        _encode_blocks(deltas[start : start + n_piece], n_block)
        for start in range(0, count, n_piece)
    ]
    tail = bytes(elements[0]).rjust(ATTRIBUTES_TAIL, b"\0")
    return bytes([ATTRIBUTES_HEAD]) + b"".join(blocks) + tail


def _encode_blocks(deltas: Bytes, n_block: int) -> bytes:
    """Return coded blocks of deltas of shape (N, stride), each of up to `n_block` elements.

    In each block, the deltas of each byte of the elements form a run. A run has the modes of its
    groups, four per byte, and then their data.
    """
    count, stride = deltas.shape
    n_blocks, n_groups = -(-count // n_block), n_block // GROUP
    padded = np.zeros((n_blocks * n_block, stride), np.uint8)
    padded[:count] = deltas
    runs = padded.reshape(n_blocks, n_block, stride).transpose(0, 2, 1).reshape(-1, n_block)
    counts = np.minimum(count - n_block * np.arange(n_blocks), n_block)
    counts = np.repeat(counts, stride)[:, np.newaxis]
    modes, data, sizes = _encode_groups(runs.reshape(-1, GROUP))
    padded_modes = np.zeros((len(runs), -(-n_groups // 4) * 4), np.uint8)
    padded_modes[:, :n_groups] = modes.reshape(-1, n_groups)
    heads = padded_modes.reshape(len(runs), -1, 4) @ QUAD_WEIGHTS
    is_head = np.arange(heads.shape[1]) < -(-counts // (4 * GROUP))
    # Groups after the count are zeros, which take no bytes.
    is_data = np.arange(GROUP) < sizes.reshape(-1, n_groups, 1)
    rows = np.concatenate([heads, data.reshape(runs.shape)], axis=1)
    return bytes(rows[np.concatenate([is_head, is_data.reshape(runs.shape)], axis=1)])


def _encode_groups(groups: Bytes) -> tuple[Bytes, Bytes, npt.NDArray[np.int64]]:
    """Return the shortest coding of groups of deltas, of shape (G, 16).

    Returns
    -------
    modes : uint8 array of shape (G,)
        Index into `WIDTHS_0`.
    data : uint8 array of shape (G, 16)
    sizes : int64 array of shape (G,)
        Number of bytes of data that count, the first of each row.
    """
    costs = np.stack([_group_bytes(groups, width) for width in WIDTHS_0])
    modes, data = costs.argmin(axis=0).astype(np.uint8), groups.copy()
    for mode, width in enumerate(WIDTHS_0):
        if width in (0, 8):
            continue
        rows, sentinel = groups[modes == mode], (1 << width) - 1
        cells = np.minimum(rows, sentinel).reshape(len(rows), 2 * width, 8 // width)
        packed = cells @ (1 << np.arange(0, 8, width)[::-1]).astype(np.uint8)
        order = np.argsort(rows < sentinel, axis=1, kind="stable")
        large_values = np.take_along_axis(rows, order, axis=1)
        data[modes == mode] = np.concatenate([packed, large_values], axis=1)[:, :GROUP]
    return modes, data, costs.min(axis=0)


def _group_bytes(groups: Bytes, width: int) -> npt.NDArray[np.int64]:
    """Return the size of groups of deltas at a width, too large where that cannot code them."""
    if width == 0:
        return np.where(groups.any(axis=1), IMPOSSIBLE, 0)
    if width == 8:
        return np.full(len(groups), GROUP)
    sizes = 2 * width + np.count_nonzero(groups >= (1 << width) - 1, axis=1)
    return np.where(sizes <= GROUP, sizes, IMPOSSIBLE)


def encode_zigzag(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return zigzag codes of integers in two's complement: 0, -1, 1, -2 become 0, 1, 2, 3."""
    signed = values.view(f"i{values.itemsize}")
    return ((signed << 1) ^ (signed >> (8 * values.itemsize - 1))).view(values.dtype)


def encode_triangles(triangles: npt.NDArray[np.integer]) -> bytes:
    """Return compressed triangles, which start at another corner if that is shorter.

    Most take one byte if they share an edge with one of the last triangles, and if vertices are
    numbered by first use.

    Parameters
    ----------
    triangles : integer array of shape (M, 3)
        Vertex indices below 2^31.
    """
    writer = _TriangleWriter()
    for triangle in triangles.tolist():
        writer.add(*triangle)
    return bytes([TRIANGLES_HEAD, *writer.codes, *writer.explicit.data]) + bytes(TRIANGLES_TAIL)


class _TriangleWriter:
    """Codes of triangles, and the state that the decoder derives from them."""

    def __init__(self) -> None:
        self.codes, self.explicit = bytearray(), _IndexWriter()
        self._edges, self._recent = _Fifo(), _Fifo()
        self._next_vertex = 0  # the first vertex that no triangle has used

    def add(self, a: int, b: int, c: int) -> None:
        """Append a triangle."""
        rotations = ((a, b, c), (b, c, a), (c, a, b))
        positions = [self._edges.position(corners[:2]) for corners in rotations]
        position = min(positions)
        if position <= MAX_EDGE:
            a, b, c = rotations[positions.index(position)]
            self.codes.append(position << 4 | self._third_corner(c))
        else:
            is_next = [corners[0] == self._next_vertex for corners in rotations]
            a, b, c = rotations[is_next.index(True) if any(is_next) else 0]
            self.codes.append(self._three_corners(a, b, c))
            self._edges.push((b, a))
        self._edges.push((c, b))
        self._edges.push((a, c))

    def _third_corner(self, corner: int) -> int:
        """Return the nibble of the corner opposite to a shared edge."""
        if 0 < (position := self._recent.position(corner)) <= MAX_THIRD:
            return position
        nibble = NEXT if self._takes_next(corner) else self.explicit.add_near(corner)
        self._recent.push(corner)
        return nibble

    def _three_corners(self, *corners: int) -> int:
        """Return the code of a triangle without shared edge."""
        nibbles: list[int] = []
        for corner in corners:
            position = self._recent.position(corner) if nibbles else FIFO_SIZE
            nibble = position + 1 if position <= MAX_CORNER else EXPLICIT
            nibbles.append(NEXT if self._takes_next(corner) else nibble)
        pairs = [pair for pair in zip(corners, nibbles, strict=True) if pair[1] in (NEXT, EXPLICIT)]
        if any(nibbles):
            self.explicit.data.append(nibbles[1] << 4 | nibbles[2])
        for corner, nibble in pairs:
            if nibble == EXPLICIT:
                self.explicit.add(corner)
            self._recent.push(corner)
        if not any(nibbles):
            return ALL_NEXT
        return FIRST_EXPLICIT if nibbles[0] == EXPLICIT else FIRST_NEXT

    def _takes_next(self, corner: int) -> bool:
        """Return whether a corner is the next unused vertex, which then is used."""
        is_next = corner == self._next_vertex
        self._next_vertex += is_next
        return is_next


class _Fifo:
    """The last edges or vertices that the decoder knows."""

    def __init__(self) -> None:
        self._pushes: dict[Any, int] = {}
        self._n_pushed = 0

    def push(self, item: Any) -> None:
        """Add an item."""
        self._pushes[item] = self._n_pushed
        self._n_pushed += 1

    def position(self, item: Any) -> int:
        """Return how many items were added after this one; at least `FIFO_SIZE` if it is gone."""
        return self._n_pushed - 1 - self._pushes.get(item, self._n_pushed - 1 - FIFO_SIZE)


class _IndexWriter:
    """Writer of the explicit indices in a triangle stream."""

    def __init__(self) -> None:
        self.data = bytearray()
        self._last = 0

    def add(self, index: int) -> None:
        """Append an index, as a difference of up to five bytes."""
        difference = index - self._last
        code = 2 * difference if difference >= 0 else -2 * difference - 1
        while code >= 128:
            self.data.append(code & 127 | 128)
            code >>= 7
        self.data.append(code)
        self._last = index

    def add_near(self, index: int) -> int:
        """Return the nibble of an index, which is appended unless it is next to the last one."""
        if abs(index - self._last) != 1:
            self.add(index)
            return EXPLICIT
        nibble = 13 if index < self._last else 14
        self._last = index
        return nibble
