"""Unsigned integers of variable length (LEB128: 7 bits per byte, low bits first)."""

from meshreel.errors import CorruptStreamError, TruncatedStreamError

MAX_BYTES = 9  # 63 bits: every value fits a signed 64-bit integer


def write_varint(value: int) -> bytes:
    """The bytes of `value`, which is in 0..2^63-1."""
    out = bytearray()
    while value >= 0x80:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)


def read_varint(data: bytes | memoryview, position: int) -> tuple[int, int]:
    """The value at `position`, and the position after it.

    Raises
    ------
    TruncatedStreamError
        If the data end inside it.
    CorruptStreamError
        If it is longer than 9 bytes.
    """
    value = 0
    for k in range(MAX_BYTES):
        if position + k >= len(data):
            raise TruncatedStreamError(f"an integer at byte {position} is cut off")
        byte = data[position + k]
        value |= (byte & 0x7F) << (7 * k)
        if byte < 0x80:
            return value, position + k + 1
    raise CorruptStreamError(f"the integer at byte {position} is longer than {MAX_BYTES} bytes")
