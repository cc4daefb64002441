"""Buffer views of a glTF file that meshoptimizer compressed.

Written from the specification of `KHR_meshopt_compression`, of which `EXT_meshopt_compression` is
the older part: https://github.com/KhronosGroup/glTF, extensions/2.0/Khronos. The library of that
name has no wheels for Python.
"""

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Bytes
from meshreel.errors import FormatError
from meshreel.formats.gltf.json_object import JsonObject
from meshreel.formats.gltf.meshopt_filters import FILTERS
from meshreel.formats.gltf.meshopt_indices import decode_indices, decode_triangles, signed_numbers

GROUP = 16
"""Elements whose deltas are coded together."""
BLOCK_BYTES, MAX_BLOCK = 8192, 256
MAX_STRIDE = 256
VERSIONS = {0xA0: 0, 0xA1: 1}
WIDTHS = {0: (0, 1, 2, 4), 1: (1, 2, 4, 8)}
"""Bits of a delta in each of the four modes of a group, by the control mode of version 1."""
WIDTHS_0 = (0, 2, 4, 8)
LOWEST = {1: 0xFFFF, 2: 0x55555555, 4: 0x1111111111111111}
"""The lowest bit of each delta of a group, by the bits of a delta."""
ALL_ZERO, LITERAL = 2, 3
FILTER_STRIDES = {"OCTAHEDRAL": (4, 8), "QUATERNION": (8,), "COLOR": (4, 8)}


def decode_view(data: bytes, packed: JsonObject) -> Bytes:
    """The bytes of a buffer view, of shape (count * byteStride,).

    Parameters
    ----------
    data : bytes
        As they are compressed.
    packed : JsonObject
        What the extension says of the buffer view.

    Raises
    ------
    FormatError
        If the data are damaged, or not what the extension says.
    """
    count, stride = packed.whole("count"), packed.whole("byteStride")
    mode, kind = packed.text("mode"), packed.text("filter", "NONE")
    if mode == "ATTRIBUTES":
        if not 0 < stride <= MAX_STRIDE or stride % 4:
            raise packed.error("byteStride", f"a multiple of 4 up to {MAX_STRIDE}")
        if kind not in FILTERS or stride not in FILTER_STRIDES.get(kind, (stride,)):
            raise packed.error("filter", f"one of {', '.join(FILTERS)}, and fit its byteStride")
    elif mode not in ("TRIANGLES", "INDICES"):
        raise packed.error("mode", "ATTRIBUTES, TRIANGLES or INDICES")
    elif stride not in (2, 4) or kind != "NONE" or (mode == "TRIANGLES" and count % 3):
        raise FormatError(
            f"{packed.place}: {mode} have no filter, a byteStride of 2 or 4, and TRIANGLES a count "
            f"that 3 divides; got {kind}, {stride} and {count}"
        )
    try:
        if mode == "ATTRIBUTES":
            return FILTERS[kind](decode_attributes(data, count, stride)).reshape(-1)
        decode = decode_triangles if mode == "TRIANGLES" else decode_indices
        return decode(data, count).astype("<u4").astype(f"<u{stride}").view(np.uint8)
    except FormatError as error:
        raise FormatError(f"{packed.place}: meshopt cannot decode it ({error})") from None


def decode_attributes(data: bytes, count: int, stride: int) -> Bytes:
    """Elements of `stride` bytes each, of shape (count, stride), before any filter.

    Raises
    ------
    FormatError
        If the data are damaged.
    """
    version = VERSIONS.get(data[0] if data else 0)
    if version is None:
        raise FormatError("has no attributes of version 0 or 1")
    n_modes = stride // 4 if version else 0
    end = len(data) - max(stride + n_modes, 24 if version else 32)
    groups, literals = _scan_groups(data, end, count, stride, version)
    deltas = np.zeros((-(-count // GROUP), GROUP, stride), np.uint8)
    stored = np.frombuffer(data, np.uint8)
    for width, found in groups.items():
        places = np.array(found, np.int64).reshape(-1, 3)
        deltas[places[:, 1], :, places[:, 2]] = _deltas(stored, places[:, 0], width)
    rows = deltas.reshape(-1, stride)
    for place, start, n_elements, channel in literals:
        rows[start : start + n_elements, channel] = stored[place : place + n_elements]
    first = len(data) - stride - n_modes
    modes = data[first + stride :] if version else bytes(stride // 4)
    return _summed(rows[:count], stored[first : first + stride], modes)


Groups = dict[int, list[tuple[int, int, int]]]
Literals = list[tuple[int, int, int, int]]


def _scan_groups(
    data: bytes, end: int, count: int, stride: int, version: int
) -> tuple[Groups, Literals]:
    """Where the deltas of each group are.

    Returns
    -------
    groups : dict of lists
        By their bits: the first byte, the number of the group and the byte of the elements.
    literals : list
        Of deltas that are stored as they are: first byte, first element, number of elements, byte
        of the elements.
    """
    groups: Groups = {1: [], 2: [], 4: [], 8: []}
    literals: Literals = []
    n_block = min((BLOCK_BYTES // stride) & ~(GROUP - 1), MAX_BLOCK)
    place = 1
    for start in range(0, count, n_block):
        n_elements = min(n_block, count - start)
        n_groups = -(-n_elements // GROUP)
        controls = data[place : place + stride // 4] if version else b""
        place += len(controls)
        for channel in range(stride):
            control = 0
            if version:
                control = _byte(controls, channel // 4) >> (2 * (channel % 4)) & 3
            if control == LITERAL:
                literals.append((place, start, n_elements, channel))
                place += n_elements
            elif control != ALL_ZERO:
                widths = WIDTHS[control] if version else WIDTHS_0
                heads, place = data[place : place + -(-n_groups // 4)], place + -(-n_groups // 4)
                for number in range(n_groups):
                    width = widths[_byte(heads, number // 4) >> (2 * (number % 4)) & 3]
                    if width:
                        groups[width].append((place, start // GROUP + number, channel))
                        place += 2 * width + _count_sentinels(data, place, width)
            if place > end:
                raise FormatError("ends before its last element")
    if place != end:
        raise FormatError(f"has {end - place} bytes behind its last element")
    return groups, literals


def _byte(data: bytes, index: int) -> int:
    if index >= len(data):
        raise FormatError("ends before its last element")
    return data[index]


def _count_sentinels(data: bytes, place: int, width: int) -> int:
    """How many deltas of a group have all bits set, and so follow as bytes."""
    if width == 8:
        return 0
    bits = int.from_bytes(data[place : place + 2 * width], "little")
    if width > 1:
        bits &= bits >> 1
    if width > 2:
        bits &= bits >> 2
    return (bits & LOWEST[width]).bit_count()


def _deltas(stored: Bytes, places: npt.NDArray[np.int64], width: int) -> Bytes:
    """The deltas of groups that begin at these bytes, of shape (G, 16)."""
    rows: Bytes = stored[places[:, np.newaxis] + np.arange(2 * width)]
    if width == 8:
        return rows
    bits = np.unpackbits(rows, axis=1, bitorder="little" if width == 1 else "big")
    weights = (1 << np.arange(width)[::-1]).astype(np.uint8)
    values: Bytes = (bits.reshape(len(rows), GROUP, width) * weights).sum(axis=2, dtype=np.uint8)
    is_behind = values == (1 << width) - 1
    behind = places[:, np.newaxis] + 2 * width + np.cumsum(is_behind, axis=1) - 1
    values[is_behind] = stored[behind[is_behind]]
    return values


def _summed(deltas: Bytes, first: Bytes, modes: bytes) -> Bytes:
    """Elements from their deltas, each relative to the one before."""
    found = np.empty_like(deltas)
    for channel, mode in enumerate(modes):
        columns = slice(4 * channel, 4 * channel + 4)
        rotation = mode >> 4
        if mode & 15 > 2 or (rotation and mode & 15 < 2):
            raise FormatError(f"has an unknown channel mode {mode}")
        dtype = ("<u1", "<u2", "<u4")[mode & 15]
        steps = np.ascontiguousarray(deltas[:, columns]).view(dtype)
        before = np.ascontiguousarray(first[columns]).view(dtype)
        if mode & 15 == 2:
            # The encoder rotates to the left.
            turned = (steps >> np.uint32(rotation)) | (steps << np.uint32((32 - rotation) & 31))
            values = np.bitwise_xor.accumulate(turned, axis=0) ^ before
        else:
            values = np.add.accumulate(signed_numbers(steps), axis=0, dtype=steps.dtype) + before
        found[:, columns] = np.ascontiguousarray(values.astype(dtype)).view(np.uint8)
    return found
