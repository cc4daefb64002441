"""Structures and codes of `core/include/meshreel.h`, for `ctypes`."""

import ctypes
from typing import Any

import numpy as np

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
"""Of `meshreel_track_kind`."""

NUMBER_TYPES: dict[int, np.dtype[Any]] = {
    dtype.itemsize + {"f": 0, "u": 16, "i": 32}[dtype.kind]: dtype for dtype in map(np.dtype, TYPES)
}
"""Of `meshreel_type`."""

_U32, _U64, _SIZE = ctypes.c_uint32, ctypes.c_uint64, ctypes.c_size_t
_POINTER, _DOUBLE = ctypes.c_void_p, ctypes.c_double


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


class Info(ctypes.Structure):
    """`meshreel_info`."""

    _fields_ = [
        ("name", Text),
        *fields_of(_DOUBLE, "fps start_s error_bound_percent"),
        ("center", _DOUBLE * 3),
        ("diagonal", _DOUBLE),
        ("size", _U64),
        *fields_of(
            _U32,
            "n_frames n_verts n_triangles n_faces n_corners n_blocks longest_block n_tracks "
            "number_bytes method laplacian order is_whole n_segments",
        ),
        ("damage", Error),
    ]


class Segment(ctypes.Structure):
    """`meshreel_segment`."""

    _fields_ = [
        *fields_of(_U32, "first_frame n_frames n_verts n_triangles"),
        *fields_of(_U64, "offset size"),
    ]


class Section(ctypes.Structure):
    """`meshreel_section`."""

    _fields_ = [
        *fields_of(_U32, "id is_known"),
        *fields_of(_U64, "offset size payload payload_size"),
    ]


class Block(ctypes.Structure):
    """`meshreel_block`."""

    _fields_ = [*fields_of(_U32, "first_frame n_frames"), *fields_of(_U64, "offset size")]


class Group(ctypes.Structure):
    """`meshreel_group`."""

    _fields_ = [
        *fields_of(_U32, "key_block n_modes"),
        ("n_corrections", _U64),
        ("step", _DOUBLE),
    ]


class Track(ctypes.Structure):
    """`meshreel_track`."""

    _fields_ = [
        ("name", Text),
        ("unit", Text),
        *fields_of(_U32, "kind domain type n_columns n_items coding is_exact reserved"),
        ("bound", _DOUBLE),
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
