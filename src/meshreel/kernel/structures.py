"""Structures and codes of `core/include/meshreel.h`, for `ctypes`."""

import ctypes
from typing import Annotated, Any

import numpy as np

from meshreel.errors import (
    CorruptStreamError,
    InvalidInputError,
    TruncatedStreamError,
    UnsupportedVersionError,
)
from meshreel.kernel.exact import TYPES
from meshreel.kernel.host import ANNOUNCE, READ, RUN

(
    OK,
    NO_MEMORY,
    TRUNCATED,
    CORRUPT,
    INVALID,
    UNSUPPORTED,
    METHOD,
    UNREADABLE,
    RANGE,
    LIMIT,
    SEGMENTS,
) = range(11)
"""Codes of `meshreel_code`."""

UNKNOWN_BYTE = 2**64 - 1
NORMAL = 3
"""MESHREEL_TRACK_NORMAL of `meshreel_track_kind`."""

NUMBER_TYPES: dict[int, np.dtype[Any]] = {
    dtype.itemsize + {"f": 0, "u": 16, "i": 32}[dtype.kind]: dtype for dtype in map(np.dtype, TYPES)
}
"""NumPy type of each code of `meshreel_type`."""

_U32, _U64, _SIZE = ctypes.c_uint32, ctypes.c_uint64, ctypes.c_size_t
_POINTER, _DOUBLE = ctypes.c_void_p, ctypes.c_double


U32 = Annotated[int, _U32]
U64 = Annotated[int, _U64]
Flag = Annotated[bool, _U32]
Double = Annotated[float, _DOUBLE]
Vector = Annotated[tuple[float, float, float], _DOUBLE * 3]
"""Fields of dataclasses, with their types in C."""


def fields_of(kind: Any, names: str) -> list[tuple[str, Any]]:
    """Fields of a structure that are of one type, for `ctypes`."""
    return [(name, kind) for name in names.split()]


class Text(ctypes.Structure):
    """`meshreel_text`."""

    _fields_ = [("bytes", _POINTER), ("size", _SIZE)]


class Error(ctypes.Structure):
    """`meshreel_error`."""

    _fields_ = [
        ("code", ctypes.c_int32),
        ("reserved", _U32),
        ("offset", _U64),
        ("size", _U64),
        ("message", ctypes.c_char_p),
    ]

    @property
    def exception(self) -> Exception:
        """Exception for damaged bytes or wrong arguments."""
        kinds: dict[int, type[Exception]] = {
            TRUNCATED: TruncatedStreamError,
            CORRUPT: CorruptStreamError,
            UNSUPPORTED: UnsupportedVersionError,
        }
        location = "" if self.offset == UNKNOWN_BYTE else f" (byte {self.offset})"
        return kinds.get(self.code, InvalidInputError)(f"{self.message.decode()}{location}")


class Source(ctypes.Structure):
    """`meshreel_source`."""

    _fields_ = [
        ("bytes", ctypes.c_char_p),
        ("size", _U64),
        ("read", READ),
        ("user", _POINTER),
        ("announce", ANNOUNCE),
    ]


class Host(ctypes.Structure):
    """`meshreel_host`."""

    _fields_ = [
        ("user", _POINTER),
        ("allocate", _POINTER),
        ("release", _POINTER),
        ("run", RUN),
        ("n_threads", _U32),
        ("reserved", _U32),
        ("memory_limit", _U64),
    ]


class Cells(ctypes.Structure):
    """`meshreel_cells`."""

    _fields_ = [
        *fields_of(_U32, "n_cells n_nodes"),
        *fields_of(_POINTER, "types nodes face_cells"),
    ]


class Modes(ctypes.Structure):
    """`meshreel_modes`."""

    _fields_ = [
        *fields_of(_U32, "n_frames n_modes n_columns n_items has_missing reserved"),
        *fields_of(_DOUBLE, "step scale"),
        *fields_of(
            _POINTER,
            "origin values rows basis shared correction_starts corrected corrections",
        ),
    ]
