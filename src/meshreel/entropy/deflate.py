"""Raw deflate, with the size of the result known beforehand."""

import zlib

from meshreel.errors import CorruptStreamError

MAX_RATIO = 1032
"""No byte of deflate unpacks to more."""


def deflate(data: bytes) -> bytes:
    """The data, packed (RFC 1951, without a header)."""
    return zlib.compress(data, level=9, wbits=-15)


def inflate(data: bytes, size_bytes: int, what: str) -> bytes:
    """Undo `deflate`; never unpacks more than one byte beyond the size.

    Parameters
    ----------
    data : bytes
    size_bytes : int
        What it must unpack to.
    what : str
        A name for error messages, in the plural.

    Raises
    ------
    CorruptStreamError
        If it unpacks to anything else.
    """
    inflater = zlib.decompressobj(wbits=-15)
    try:
        raw = inflater.decompress(data, size_bytes + 1)
    except zlib.error as error:
        raise CorruptStreamError(f"the {what} do not inflate: {error}") from error
    if len(raw) != size_bytes or not inflater.eof or inflater.unused_data:
        raise CorruptStreamError(f"the {what} hold {len(raw)} bytes; {size_bytes} are needed")
    return raw
