"""Raw deflate; the size of the result is known in advance."""

import zlib

from meshreel.errors import CorruptStreamError

MAX_RATIO = 1032
"""Largest ratio of unpacked to packed bytes that deflate reaches."""


def deflate(data: bytes) -> bytes:
    """The compressed data (RFC 1951, without a header)."""
    return zlib.compress(data, level=9, wbits=-15)


def inflate(data: bytes, size_bytes: int, what: str) -> bytes:
    """The data that `deflate` compressed; never unpacks more than one byte beyond the size.

    Parameters
    ----------
    data : bytes
    size_bytes : int
        Size of the unpacked data.
    what : str
        A name for error messages, in the plural.

    Raises
    ------
    CorruptStreamError
        If it unpacks to any other size.
    """
    inflater = zlib.decompressobj(wbits=-15)
    try:
        raw = inflater.decompress(data, size_bytes + 1)
    except zlib.error as error:
        raise CorruptStreamError(f"the {what} do not inflate: {error}") from error
    if len(raw) != size_bytes or not inflater.eof or inflater.unused_data:
        raise CorruptStreamError(f"the {what} hold {len(raw)} bytes; {size_bytes} are needed")
    return raw
