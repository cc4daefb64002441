"""The reader in C, `core/reader/meshreel.h`, as a program would use it: by ctypes."""

import ctypes
from dataclasses import dataclass, field

import numpy as np

from meshreel.kernel.library import library

OK, NO_MEMORY, TRUNCATED, CORRUPT, INVALID, UNSUPPORTED, METHOD, UNREADABLE, RANGE = range(9)
READ = ctypes.CFUNCTYPE(
    ctypes.c_int, ctypes.c_void_p, ctypes.c_uint64, ctypes.c_void_p, ctypes.c_size_t
)
COUNTS = (
    "n_frames", "n_verts", "n_triangles", "n_blocks", "longest_block", "n_tracks", "number_bytes",
    "method", "order", "is_whole",
)  # fmt: skip


class Source(ctypes.Structure):
    """`meshreel_source`."""

    _fields_ = (
        ("bytes", ctypes.c_char_p),
        ("size", ctypes.c_uint64),
        ("read", READ),
        ("user", ctypes.c_void_p),
    )


class Info(ctypes.Structure):
    """`meshreel_info`."""

    _fields_ = (
        ("file_bytes", ctypes.c_uint64),
        ("decoder_bytes", ctypes.c_uint64),
        *((name, ctypes.c_double) for name in ("fps", "start_s", "promise_percent")),
        ("centre", ctypes.c_double * 3),
        ("diagonal", ctypes.c_double),
        *((name, ctypes.c_uint32) for name in COUNTS),
        ("reserved", ctypes.c_uint64 * 4),
    )


class RefusalError(Exception):
    """What the reader answers but OK."""

    def __init__(self, code):
        super().__init__(f"{code}: {words(code)}")
        self.code = code


def words(code):
    """What a code means."""
    function = library().meshreel_words
    function.restype = ctypes.c_char_p
    return function(ctypes.c_int(code)).decode()


def call(name, *arguments):
    """Call a function that returns a code; raises `RefusalError`."""
    code = library()[name](*arguments)
    if code:
        raise RefusalError(code)


def in_memory(data):
    """A source of bytes in memory."""
    return Source(data, len(data), READ(), None)


def by_calls(data, fails_at=None):
    """A source whose bytes are asked for; asking for byte `fails_at` fails."""

    def read(_, offset, to, size):
        assert offset + size <= len(data)
        if fails_at is not None and offset <= fails_at < offset + size:
            return 1
        ctypes.memmove(to, data[offset : offset + size], size)
        return 0

    return Source(None, len(data), READ(read), None)


def inspect(source):
    """The `Info` of a source."""
    info = Info()
    call("meshreel_inspect", ctypes.byref(source), ctypes.byref(info))
    return info


@dataclass
class Decoder:
    """A decoder of an open file."""

    file: "File"
    given: int | None = None
    memory: object = field(init=False)
    at: ctypes.c_void_p = field(init=False, default_factory=ctypes.c_void_p)

    def __post_init__(self):
        size = self.file.info.decoder_bytes if self.given is None else self.given
        self.memory = ctypes.create_string_buffer(size)
        length = ctypes.c_size_t(size)
        call("meshreel_begin", self.file.at, self.memory, length, ctypes.byref(self.at))

    def load(self, frame):
        """Load the block of a frame."""
        call("meshreel_load", self.at, ctypes.c_uint32(frame))

    def frame(self, number, dtype=np.float32):
        """Positions of a frame, of shape (V, 3)."""
        out = np.empty((self.file.info.n_verts, 3), dtype)
        name = "meshreel_decode" if dtype == np.float32 else "meshreel_decode_doubles"
        call(name, self.at, ctypes.c_uint32(number), ctypes.c_void_p(out.ctypes.data))
        return out

    def normals(self, positions):
        """Normals at the vertices."""
        out = np.empty_like(positions)
        places = (ctypes.c_void_p(array.ctypes.data) for array in (positions, out))
        call("meshreel_normals", self.at, *places)
        return out


@dataclass
class File:
    """An open file, in memory that begins `off` bytes behind a block of it."""

    source: Source
    given: int | None = None
    off: int = 0
    info: Info = field(init=False)
    memory: object = field(init=False)
    at: ctypes.c_void_p = field(init=False, default_factory=ctypes.c_void_p)

    def __post_init__(self):
        self.info = inspect(self.source)
        size = self.info.file_bytes if self.given is None else self.given
        self.memory = ctypes.create_string_buffer(size + self.off)
        begin = ctypes.c_void_p(ctypes.addressof(self.memory) + self.off)
        length = ctypes.c_size_t(size)
        call("meshreel_open", ctypes.byref(self.source), begin, length, ctypes.byref(self.at))

    @property
    def dtype(self):
        """Number type of positions, as they came."""
        return np.float32 if self.info.number_bytes == 4 else np.float64

    @property
    def triangles(self):
        """Of shape (M, 3)."""
        function = library().meshreel_triangles
        function.restype = ctypes.POINTER(ctypes.c_uint32)
        return np.ctypeslib.as_array(function(self.at), (self.info.n_triangles, 3)).copy()

    def block_of(self, frame):
        """First frame and number of frames of the block of a frame."""
        found = ctypes.c_uint32(), ctypes.c_uint32()
        call("meshreel_block_of", self.at, ctypes.c_uint32(frame), *map(ctypes.byref, found))
        return tuple(one.value for one in found)

    def frames(self, order=None):
        """All frames, of shape (T, V, 3), decoded in an order."""
        decoder = Decoder(self)
        out = np.empty((self.info.n_frames, self.info.n_verts, 3), self.dtype)
        for number in range(len(out)) if order is None else order:
            out[number] = decoder.frame(number, self.dtype)
        return out
