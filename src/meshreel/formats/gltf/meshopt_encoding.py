"""Encoding of buffer views of a glTF file as the decoder of meshoptimizer expects.

Implemented from the specification of `KHR_meshopt_compression`, which extends
`EXT_meshopt_compression`: https://github.com/KhronosGroup/glTF, extensions/2.0/Khronos. The streams
are version 0 of attributes, which both extensions allow, and version 1 of triangles.
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

ATTRIBUTES_HEAD, MIN_TAIL = 0xA0, 32

NEXT, EXPLICIT = 0, 15
"""Nibbles of the next unused vertex, and of an index that is stored explicitly."""
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
    n_groups = min(BLOCK_BYTES // stride, MAX_BLOCK) // GROUP  # per block
    n_blocks = -(-count // (n_groups * GROUP))
    padded = np.zeros((n_blocks * n_groups * GROUP, stride), np.uint8)
    padded[1:count] = encode_zigzag(np.diff(elements, axis=0))
    deltas = padded.reshape(n_blocks, n_groups, GROUP, stride).transpose(0, 3, 1, 2)
    modes, data, sizes = _encode_groups(np.ascontiguousarray(deltas).reshape(-1, GROUP))
    # Each byte of a block has two bits per group in front of the groups.
    quads = np.zeros((n_blocks * stride, -(-n_groups // 4), 4), np.uint8)
    quads.reshape(len(quads), -1)[:, :n_groups] = modes.reshape(-1, n_groups)
    heads = quads @ np.array([1, 4, 16, 64], np.uint8)
    are_stored = np.ones((n_blocks, stride, heads.shape[1]), bool)
    n_last_groups = -(-count // GROUP) - (n_blocks - 1) * n_groups
    are_stored[-1, :, -(-n_last_groups // 4) :] = False
    rows = np.concatenate([heads, data.reshape(len(heads), -1)], axis=1)
    is_data = np.arange(GROUP) < sizes[:, np.newaxis]
    is_stored = [are_stored.reshape(heads.shape), is_data.reshape(len(heads), -1)]
    stored: Bytes = rows[np.concatenate(is_stored, axis=1)]
    tail = bytes(max(0, MIN_TAIL - stride)) + bytes(elements[0])
    return bytes([ATTRIBUTES_HEAD]) + bytes(stored) + tail


def _encode_groups(groups: Bytes) -> tuple[Bytes, Bytes, npt.NDArray[np.int64]]:
    """Return the shortest coding of groups of deltas, of shape (G, 16).

    Returns
    -------
    modes : uint8 array of shape (G,)
        Index into `WIDTHS_0`.
    data : uint8 array of shape (G, 16)
    sizes : int64 array of shape (G,)
        Number of bytes of data that count.
    """
    sentinels = [(1 << width) - 1 for width in WIDTHS_0[:-1]]
    exceeding = [np.count_nonzero(groups >= sentinel, axis=1) for sentinel in sentinels]
    lengths = [GROUP * width // 8 + n for width, n in zip(WIDTHS_0, exceeding, strict=False)]
    lengths[0] = np.where(groups.any(axis=1), GROUP + 1, 0)  # a width of 0 has no sentinel
    costs = np.stack([*lengths, np.full(len(groups), GROUP)])
    modes, data = costs.argmin(axis=0).astype(np.uint8), groups.copy()
    for mode in (1, 2):
        rows, width, sentinel = groups[modes == mode], WIDTHS_0[mode], sentinels[mode]
        is_large = rows >= sentinel
        cells = np.minimum(rows, sentinel).reshape(len(rows), 2 * width, 8 // width)
        packed = cells @ (1 << np.arange(8 - width, -1, -width)).astype(np.uint8)
        order = np.argsort(~is_large, axis=1, kind="stable")
        large = np.take_along_axis(rows, order, axis=1)
        data[modes == mode] = np.concatenate([packed, large], axis=1)[:, :GROUP]
    return modes, data, costs.min(axis=0)


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
    codes, explicit = bytearray([TRIANGLES_HEAD]), _IndexWriter()
    edges, recent = _Fifo(), _Fifo()
    next_vertex = 0  # the first vertex that no triangle has used
    for a, b, c in triangles.tolist():
        rotations = ((a, b, c), (b, c, a), (c, a, b))
        positions = [edges.position(corners[:2]) for corners in rotations]
        edge = min(positions)
        if edge <= MAX_EDGE:
            a, b, c = rotations[positions.index(edge)]
            vertex = recent.position(c)
            if c == next_vertex:
                low, next_vertex = NEXT, next_vertex + 1
            elif 0 < vertex <= MAX_THIRD:
                low = vertex
            else:
                low = explicit.add_near(c)
            if not 0 < low <= MAX_THIRD:
                recent.push(c)
            codes.append(edge << 4 | low)
        else:
            starts = [corners[0] for corners in rotations]
            a, b, c = rotations[starts.index(next_vertex) if next_vertex in starts else 0]
            kinds: list[int] = []
            for corner in (a, b, c):
                vertex = recent.position(corner) if kinds else FIFO_SIZE
                kinds.append(vertex + 1 if vertex <= MAX_CORNER else EXPLICIT)
                if corner == next_vertex:
                    kinds[-1], next_vertex = NEXT, next_vertex + 1
            codes.append(0xF0 if not any(kinds) else 0xFE if kinds[0] == NEXT else 0xFF)
            if any(kinds):
                explicit.data.append(kinds[1] << 4 | kinds[2])
            for kind, corner in zip(kinds, (a, b, c), strict=True):
                if kind == EXPLICIT:
                    explicit.add(corner)
            edges.push((b, a))
            for kind, corner in zip(kinds, (a, b, c), strict=True):
                if kind in (NEXT, EXPLICIT):
                    recent.push(corner)
        edges.push((c, b))
        edges.push((a, c))
    return bytes(codes + explicit.data) + bytes(TRIANGLES_TAIL)


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
