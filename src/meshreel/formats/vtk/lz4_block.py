"""Blocks packed by LZ4, unpacked: no library of the core does."""

from meshreel.errors import FormatError


def unpack_lz4(packed: bytes, size_bytes: int) -> bytes:
    """The bytes of an LZ4 block, which must be so many.

    Raises
    ------
    FormatError
        If it is damaged.
    """
    found = bytearray()
    at = 0
    try:
        while at < len(packed):
            token = packed[at]
            length, at = _length(packed, at + 1, token >> 4)
            if at + length > len(packed):
                break
            found += packed[at : at + length]
            at += length
            if at == len(packed) and len(found) == size_bytes:
                return bytes(found)
            back = packed[at] | packed[at + 1] << 8
            length, at = _length(packed, at + 2, token & 15)
            if not 0 < back <= len(found) or len(found) + length + 4 > size_bytes:
                break
            _repeat(found, back, length + 4)
    except IndexError:
        pass
    raise FormatError("holds a block that is not of LZ4, or is damaged")


def _length(packed: bytes, at: int, begun: int) -> tuple[int, int]:
    """A length whose first four bits are known, and where what follows it begins."""
    if begun == 15:
        while packed[at] == 255:
            begun, at = begun + 255, at + 1
        begun, at = begun + packed[at], at + 1
    return begun, at


def _repeat(found: bytearray, back: int, length: int) -> None:
    """Append bytes that begin so far back, and may go on in what is appended."""
    piece = bytes(found[-back:] if back >= length else found[-back:] * (length // back + 1))
    found += piece[:length]
