"""Bit packing: fields of given widths without gaps, least significant bit first."""

import numpy as np
import numpy.typing as npt

Integers = npt.NDArray[np.int64]

MAX_WIDTH = 32


def pack_bits(fields: Integers, widths: Integers) -> bytes:
    """Bytes of the packed fields, field i in `widths[i]` bits (0..32).

    Every field is below 2^width and not negative.
    """
    ends = np.cumsum(widths)
    is_wide = widths > 0  # few, as a rule
    starts, fields = (ends - widths)[is_wide], fields[is_wide]
    if not len(fields):
        return b""
    n_bytes = int((ends[-1] + 7) >> 3)
    shifted = fields << (starts & 7)
    first_byte = starts >> 3
    packed = np.zeros(n_bytes + 5, np.int64)
    for k in range(5):  # a field of 32 bits shifted by 7 touches five bytes
        piece = (shifted >> (8 * k)) & 0xFF
        packed += np.bincount(first_byte + k, piece, n_bytes + 5)[: n_bytes + 5].astype(np.int64)
    return packed[:n_bytes].astype(np.uint8).tobytes()


def unpack_bits(data: bytes, widths: Integers) -> Integers:
    """Fields that `pack_bits` wrote; `data` must hold at least the sum of their widths."""
    if not np.any(widths):
        return np.zeros(len(widths), np.int64)
    ends = np.cumsum(widths)
    starts = ends - widths
    padded = np.zeros(len(data) + 5, np.int64)
    padded[: len(data)] = np.frombuffer(data, np.uint8)
    first_byte = starts >> 3
    window = np.zeros(len(widths), np.int64)
    for k in range(5):
        window |= padded[first_byte + k] << (8 * k)
    return (window >> (starts & 7)) & ((np.int64(1) << widths) - 1)


def packed_size_bytes(widths: Integers) -> int:
    """Bytes that `pack_bits` writes for these widths."""
    return (int(np.sum(widths)) + 7) >> 3
