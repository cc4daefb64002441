"""The C library of `core/include/meshreel.h`, called through ctypes."""

import ctypes
import re
from concurrent.futures import ThreadPoolExecutor
from ctypes import byref, c_char_p, c_double, c_int, c_int32, c_size_t, c_uint32, c_uint64, c_void_p
from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy as np

from meshreel.kernel.library import library
from meshreel.kernel.structures import NUMBER_TYPES
from meshreel.model.cells import Cells

UNKNOWN_OFFSET = 2**64 - 1
ALIGNMENT = 64


class Code(IntEnum):
    """`meshreel_code`."""

    OK = 0
    NO_MEMORY = 1
    TRUNCATED = 2
    CORRUPT = 3
    INVALID = 4
    UNSUPPORTED = 5
    METHOD = 6
    UNREADABLE = 7
    RANGE = 8
    LIMIT = 9
    SEGMENTS = 10


DAMAGED = (Code.TRUNCATED, Code.CORRUPT, Code.UNSUPPORTED)
FLOAT32 = 4

READ = ctypes.CFUNCTYPE(c_int, c_void_p, c_uint64, c_void_p, c_size_t)
ALLOCATE = ctypes.CFUNCTYPE(c_void_p, c_void_p, c_size_t)
RELEASE = ctypes.CFUNCTYPE(None, c_void_p, c_void_p, c_size_t)
TASK = ctypes.CFUNCTYPE(None, c_void_p, c_uint32)
RUN = ctypes.CFUNCTYPE(None, c_void_p, c_void_p, c_void_p, c_uint32)


class _Text(ctypes.Structure):
    def __str__(self):
        return ctypes.string_at(self.bytes, self.size).decode() if self.size else ""


class _Track(ctypes.Structure):
    @property
    def dtype(self):
        return NUMBER_TYPES[self.type]


BASES = {"text": _Text, "track": _Track}
MEMBERS = {"read": READ, "allocate": ALLOCATE, "release": RELEASE, "run": RUN, "message": c_char_p,
           "source.bytes": c_char_p}  # fmt: skip
"""Types of callbacks and of pointers to strings; other pointers to values are `c_void_p`."""

NUMBERS = {"int32_t": c_int32, "uint32_t": c_uint32, "uint64_t": c_uint64, "size_t": c_size_t,
           "double": c_double}  # fmt: skip


def structures(header):
    """Return the structures that a header in C declares, by their names without `meshreel_`."""
    header = re.sub(r"/\*.*?\*/", "", header, flags=re.DOTALL)
    counts = dict(re.findall(r"(\w+) = (\d+)", header))
    declared: dict[str, Any] = {}
    for body, name in re.findall(
        r"typedef struct \w+ \{(.*?)\} meshreel_(\w+);", header, re.DOTALL
    ):
        fields = []
        for declaration in body.split(";")[:-1]:
            kind, members = re.match(r"\s*(?:const )?(\w+) (.*)", declaration, re.DOTALL).groups()
            for member in [members] if "(" in members else members.split(","):
                pointer, field, count = re.match(
                    r"\s*(\*?)(?:\(\*)?(\w+)(?:\[(\w+)\])?", member
                ).groups()
                type_ = NUMBERS.get(kind) or declared.get(kind.removeprefix("meshreel_"))
                if pointer or "(" in members:
                    is_structure = kind.startswith("meshreel_")
                    type_ = ctypes.POINTER(type_) if is_structure else c_void_p
                    type_ = MEMBERS.get(field) or MEMBERS.get(f"{name}.{field}", type_)
                fields.append((field, type_ * int(counts.get(count, count)) if count else type_))
        base = BASES.get(name, ctypes.Structure)
        declared[name] = type(name, (base,), {"_fields_": fields})
    return declared


HEADER = Path(__file__).parents[2] / "core" / "include" / "meshreel.h"
STRUCTURES = structures(HEADER.read_text(encoding="utf-8"))
(CError, Source, CHost, Info, Segment, Section, Block, CSurface, Track, Group, CModes, Layout,
 CCells) = (
    STRUCTURES[name]
    for name in (
        "error", "source", "host", "info", "segment", "section", "block", "surface", "track",
        "group", "modes", "layout", "cells",
    )
)  # fmt: skip

libc = ctypes.CDLL(None)
libc.aligned_alloc.restype = c_void_p
libc.aligned_alloc.argtypes = [c_size_t, c_size_t]
libc.free.argtypes = [c_void_p]


class RefusalError(Exception):
    """A call returned an error code."""

    def __init__(self, code, error=None):
        message = error.message.decode() if error else ""
        super().__init__(f"{Code(code).name}: {message}")
        self.code = code
        self.offset = error.offset if error else None
        self.size = error.size if error else None


def refusal(act):
    """Return the error of a call; None if it succeeds."""
    try:
        act()
    except RefusalError as refused:
        return refused
    return None


def code_of(act):
    """Return the error code of a call."""
    refused = refusal(act)
    return refused.code if refused else Code.OK


def call(name, *arguments):
    """Call a function that fills an error; raise `RefusalError` if it fails."""
    error = CError()
    code = library()["meshreel_" + name](*arguments, byref(error))
    assert error.code == code
    if code:
        assert error.message
        raise RefusalError(code, error)


def returned(name, kind, *arguments):
    """Return the result of a function that cannot fail."""
    function = library()["meshreel_" + name]
    function.restype = kind
    return function(*arguments)


def array_at(address, shape, dtype):
    """Copy an array from C memory."""
    dtype = np.dtype(dtype)
    size = int(np.prod(shape)) * dtype.itemsize
    data = ctypes.string_at(address, size) if size else b""
    return np.frombuffer(data, dtype).reshape(shape)


class Host:
    """Memory and threads for the library; tracks its allocations.

    Parameters
    ----------
    n_threads : int
    limit : int
        `memory_limit`.
    fails_at : int, optional
        Index of the allocation that returns NULL.
    """

    def __init__(self, n_threads=1, limit=0, fails_at=None):
        self.held, self.n_allocations, self.largest = {}, 0, 0
        self.fails_at = fails_at
        self.pool = ThreadPoolExecutor(n_threads) if n_threads > 1 else None
        run = RUN(self._run) if self.pool else RUN()
        self.c = CHost(
            None, ALLOCATE(self._allocate), RELEASE(self._release), run, n_threads, 0, limit
        )

    def _allocate(self, _, size):
        self.n_allocations += 1
        if self.n_allocations - 1 == self.fails_at:
            return None
        memory = libc.aligned_alloc(ALIGNMENT, -(-size // ALIGNMENT) * ALIGNMENT)
        self.held[memory] = size
        self.largest = max(self.largest, sum(self.held.values()))
        return memory

    def _release(self, _, memory, size):
        assert self.held.pop(memory) == size
        libc.free(memory)

    def _run(self, _, task, shared, n_tasks):
        one = TASK(task)
        list(self.pool.map(lambda i: one(shared, i), range(n_tasks)))


def in_memory(data):
    return Source(data, len(data), READ(), None)


def by_calls(data, allows=None):
    """A source that reads through a callback; ranges that `allows(offset, end)` denies fail."""

    def read(_, offset, to, size):
        assert size
        assert offset + size <= len(data)
        if allows and not allows(offset, offset + size):
            return 1
        ctypes.memmove(to, data[offset : offset + size], size)
        return 0

    return Source(None, len(data), READ(read), None)


class File:
    """An open file, or segment `number` of `whole`; its mesh is decoded unless `mesh` is false."""

    def __init__(self, source, host=None, mesh=True, whole=None, number=0):
        self.source = in_memory(source) if isinstance(source, bytes) else source
        self.host = host or Host()
        self.handle = c_void_p()
        if whole:
            call("open_segment", whole.handle, c_uint32(number), byref(self.handle))
        else:
            call("open", byref(self.source), byref(self.host.c), byref(self.handle))
        self.info = returned("info_of", ctypes.POINTER(Info), self.handle).contents
        try:
            if mesh:
                self.read_mesh()
        except RefusalError:
            self.close()
            raise

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        """Close the file; its decoders must be closed."""
        library().meshreel_close(self.handle)
        self.handle = c_void_p()

    def open_segment(self, number, mesh=True):
        return File(self.source, self.host, mesh, whole=self, number=number)

    def segment(self, number):
        """Frames, mesh and bytes of a segment."""
        result = Segment()
        code = library().meshreel_segment_of(self.handle, c_uint32(number), byref(result))
        if code:
            raise RefusalError(code)
        return result

    @property
    def segments(self):
        return [self.segment(number) for number in range(self.info.n_segments)]

    def segment_of_frame(self, frame):
        return returned("segment_of_frame", c_uint32, self.handle, c_uint32(frame))

    @property
    def times(self):
        """Times of all frames in seconds, or None if they are evenly spaced."""
        address = returned("times_of", c_void_p, self.handle)
        return array_at(address, (self.info.n_frames,), np.float64).tolist() if address else None

    def frame_at(self, time_s):
        """Number of the frame that is shown at a time."""
        return returned("frame_at", c_uint32, self.handle, c_double(time_s))

    def read_mesh(self):
        call("read_mesh", self.handle)

    def check(self):
        """Check the announced sizes of the mesh and of all blocks."""
        call("check", self.handle, c_uint32(0), c_uint32(self.info.n_frames), c_uint32(0))

    @property
    def triangles(self):
        """Of shape (M, 3), or None before the mesh is decoded."""
        address = returned("triangles", c_void_p, self.handle)
        return array_at(address, (self.info.n_triangles, 3), np.uint32) if address else None

    def track(self, number):
        result = Track()
        code = library().meshreel_track_of(self.handle, c_uint32(number), byref(result))
        if code:
            raise RefusalError(code)
        return result

    @property
    def tracks(self):
        """All tracks, the positions first."""
        return [self.track(number) for number in range(self.info.n_tracks)]

    def block(self, number, track=0):
        """Frames and bytes of a track in a block."""
        result = Block()
        arguments = self.handle, c_uint32(number), c_uint32(track), byref(result)
        code = library().meshreel_block_of(*arguments)
        if code:
            raise RefusalError(code)
        return result

    def group(self, number, track=0, check=True):
        """Return the header of a track in a block."""
        result = Group()
        numbers = c_uint32(number), c_uint32(track), c_int(check)
        call("group_of", self.handle, *numbers, byref(result))
        return result

    def block_of_frame(self, frame):
        return returned("block_of_frame", c_uint32, self.handle, c_uint32(frame))

    def section(self, offset, check=True):
        """Return the section that begins at a byte."""
        result = Section()
        call("section_at", self.handle, c_uint64(offset), c_int(check), byref(result))
        return result

    def read_surface(self):
        call("read_surface", self.handle)

    @property
    def cells(self):
        """The cells as a value of the package, or None; checks the cells of the faces."""
        address = returned("cells_of", ctypes.POINTER(CCells), self.handle)
        if not address:
            return None
        c = address.contents
        types = array_at(c.types, c.n_cells, np.uint8)
        cells = Cells(types, array_at(c.nodes, c.n_nodes, np.uint32).astype(np.int32))
        owners = array_at(c.face_cells, self.info.n_faces, np.uint32)
        np.testing.assert_array_equal(owners, cells.surface(self.info.n_verts).owners)
        assert c.n_cells == self.info.n_cells
        return cells

    def values(self, track=0, n_modes=0):
        """Decode all frames of a track with a new decoder."""
        with Decoder(self) as decoder:
            return decoder.frames(track, 0, self.info.n_frames, n_modes)


class Decoder:
    """A decoder of an open file."""

    def __init__(self, file):
        self.file, self.handle = file, c_void_p()
        call("begin", file.handle, byref(self.handle))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        """Release the decoder."""
        library().meshreel_end(self.handle)
        self.handle = c_void_p()

    def load(self, track, block, n_modes=0):
        call("load", self.handle, c_uint32(track), c_uint32(block), c_uint32(n_modes))

    def values_of_modes(self, track, block):
        """Compute the values of a block from its modes, of shape (T, N, C); None without modes."""
        modes = CModes()
        call("modes_of", self.handle, c_uint32(track), c_uint32(block), byref(modes))
        if not modes.n_modes:
            return None
        n_frames, n_items, n_columns = modes.n_frames, modes.n_items, modes.n_columns
        values = array_at(modes.values, n_items * modes.n_modes, np.float64)
        basis = array_at(modes.basis, n_columns * n_frames * modes.n_modes, np.float64)
        rows = array_at(modes.rows, n_items, np.int32)
        result = np.einsum(
            "nk,ctk->tnc",
            modes.step * values.reshape(n_items, -1)[rows],
            basis.reshape(n_columns, n_frames, -1),
        )
        if modes.correction_starts:
            starts = array_at(modes.correction_starts, n_frames + 1, np.int64)
            items = array_at(modes.corrected, starts[-1], np.int32)
            moves = array_at(modes.corrections, starts[-1] * n_columns, np.float64)
            frames = np.repeat(np.arange(n_frames), np.diff(starts))
            np.add.at(result, (frames, items), moves.reshape(-1, n_columns))
        result = modes.scale * result + array_at(modes.origin, n_columns, np.float64)
        if modes.shared:
            n_corners = self.file.track(track).n_items
            result = result[:, array_at(modes.shared, n_corners, np.int32)]
        return result

    def decode(self, out, track, first, count, n_modes=0, layout=None):
        layout_pointer = byref(layout) if layout else None
        numbers = (c_uint32(number) for number in (track, first, count, n_modes))
        call("decode", self.handle, *numbers, layout_pointer, c_void_p(out.ctypes.data))

    def frames(self, track=0, first=0, count=None, n_modes=0, dtype=None):
        """Decode frames, of shape (count, N, C)."""
        track_info = self.file.track(track)
        count = self.file.info.n_frames - first if count is None else count
        out = np.empty((count, track_info.n_items, track_info.n_columns), dtype or track_info.dtype)
        layout = Layout(type=FLOAT32) if dtype == np.float32 else None
        self.decode(out, track, first, count, n_modes, layout)
        return out

    def normals(self, positions):
        """Compute vertex normals of one frame."""
        out = np.empty_like(positions)
        places = (c_void_p(array.ctypes.data) for array in (positions, out))
        call("normals", self.handle, c_uint32(positions.itemsize), *places)
        return out
