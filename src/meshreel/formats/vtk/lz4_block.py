"""Decompression of LZ4 blocks, so that VTK files need no LZ4 library."""

from meshreel.errors import FormatError


def unpack_lz4(packed: bytes, size_bytes: int) -> bytes:
    """Decompress an LZ4 block to exactly `size_bytes` bytes.

    Raises
    ------
    FormatError
        If the block is damaged or has another size.
    """
    output = bytearray()
    at = 0
    try:
        while at < len(packed):
            token = packed[at]
            length, at = _length(packed, at + 1, token >> 4)
            if at + length > len(packed):
                break
            output += packed[at : at + length]
            at += length
            if at == len(packed) and len(output) == size_bytes:
                return bytes(output)
            distance = packed[at] | packed[at + 1] << 8
            length, at = _length(packed, at + 2, token & 15)
            if not 0 < distance <= len(output) or len(output) + length + 4 > size_bytes:
                break
            _repeat(output, distance, length + 4)
    except IndexError:
        pass
    raise FormatError("contains a block that is not LZ4, or is damaged")


def _length(packed: bytes, at: int, nibble: int) -> tuple[int, int]:
    """Length that starts with the nibble of a token, and the offset after its extra bytes."""
    length = nibble
    if nibble == 15:
        while packed[at] == 255:
            length, at = length + 255, at + 1
        length, at = length + packed[at], at + 1
    return length, at


def _repeat(output: bytearray, distance: int, length: int) -> None:
    """Append a match of `length` bytes from `distance` bytes back; they may overlap."""
    match = output[-distance:]
    output += (match if distance >= length else match * (length // distance + 1))[:length]
