"""Packets of arrays that a page reads in place: a JSON header, then the arrays, little-endian."""

import json
from collections.abc import Mapping
from typing import Any

import numpy.typing as npt

ALIGNMENT = 8
TYPES = ("uint8", "int8", "uint16", "int16", "uint32", "float32")
"""Number types that a page has typed arrays for and that it is sent."""


def packet(arrays: Mapping[str, npt.NDArray[Any]], **fields: Any) -> bytes:
    """A packet: length of its header as uint32, the header, and the arrays.

    Header and arrays are padded so that every array begins at a multiple of 8 bytes.

    Parameters
    ----------
    arrays : mapping of name to array
        Each of one of `TYPES`.
    **fields
        Further fields of the header, in plain types.
    """
    entries, offset = [], 0
    for name, array in arrays.items():
        assert array.dtype.name in TYPES, array.dtype  # the callers are all in this room
        shape = list(array.shape)
        entries.append({"name": name, "type": array.dtype.name, "shape": shape, "offset": offset})
        offset += _padded(array.nbytes)
    header = json.dumps({"arrays": entries, **fields}, separators=(",", ":")).encode()
    header = header.ljust(_padded(4 + len(header)) - 4)
    return b"".join([len(header).to_bytes(4, "little"), header, *map(_bytes, arrays.values())])


def _bytes(array: npt.NDArray[Any]) -> bytes:
    data = array.astype(array.dtype.newbyteorder("<"), copy=False).tobytes()
    return data.ljust(_padded(len(data)), b"\0")


def _padded(size_bytes: int) -> int:
    return -(-size_bytes // ALIGNMENT) * ALIGNMENT
