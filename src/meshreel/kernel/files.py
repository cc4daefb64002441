"""Binding of the core's decoder of `.reel` files, `core/include/meshreel.h`."""

import ctypes
import os
import threading
from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass
from functools import cache, cached_property, partial
from io import BytesIO
from typing import Annotated, Any, BinaryIO, TypeVar, get_type_hints
from weakref import finalize

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError, Keyword, MemoryLimitError
from meshreel.kernel.host import ALLOCATOR, ANNOUNCE, READ, RUN, TASK, HostMemory, SourceReader
from meshreel.kernel.library import library
from meshreel.kernel.mp4 import MediaTrack, find_reel, read_media
from meshreel.kernel.structures import (
    LIMIT,
    NO_MEMORY,
    NORMAL,
    NUMBER_TYPES,
    OK,
    U32,
    U64,
    UNREADABLE,
    Cells,
    Double,
    Error,
    Flag,
    Host,
    Modes,
    Source,
    Text,
    Vector,
)
from meshreel.runtime.counting import counted, size_text
from meshreel.runtime.threads import POOL, fork_safe_lock, n_cores, pool

Integers = npt.NDArray[np.int32]

_U32, _U64, _POINTER = ctypes.c_uint32, ctypes.c_uint64, ctypes.c_void_p


Record = TypeVar("Record")
String = Annotated[str, Text]
Damage = Annotated[Exception | None, Error]
NumberType = Annotated[np.dtype[Any], _U32]


@dataclass(frozen=True)
class FileInfo:
    """Contents of the header and the index of a file or a segment, `meshreel_info`.

    For a file of several segments, `error_bound_percent` and all counts but `n_frames` are 0.
    """

    name: String
    fps: Double
    start_s: Double
    error_bound_percent: Double
    """Guaranteed bound of the displacement of vertices, in percent of the diagonal; 0: none."""
    center: Vector
    diagonal: Double
    """Diagonal of the bounding box of all frames, in model units."""
    size_bytes: U64
    """Bytes up to the end of the file or, if it is damaged, of the last complete block."""
    n_frames: U32
    n_verts: U32
    n_triangles: U32
    n_faces: U32
    n_corners: U32
    n_blocks: U32
    longest_block: U32
    """Number of frames in the longest block."""
    n_tracks: U32
    """Number of tracks, including the positions."""
    number_bytes: U32
    method: U32
    laplacian: U32
    order: U32
    is_whole: Flag
    """Whether the file is complete, up to its end section."""
    n_segments: U32
    n_cells: U32
    """Number of volume cells; 0 if the mesh has faces only."""
    reserved: U32
    damage: Damage
    """The error because of which the file is not whole; None if it is."""


@dataclass(frozen=True)
class FileSegment:
    """A mesh of constant connectivity in a file, and its frames: `meshreel_segment`."""

    first_frame: U32
    """Number of its first frame in the file."""
    n_frames: U32
    n_verts: U32
    n_triangles: U32
    offset: U64
    size_bytes: U64
    """Size of the segment, without the header of the file."""


@dataclass(frozen=True)
class FileSection:
    """A section of a file: its id, its bytes, and those of its payload: `meshreel_section`."""

    id: U32
    is_known: Flag
    offset: U64
    size_bytes: U64
    payload_offset: U64
    payload_bytes: U64


@dataclass(frozen=True)
class FileBlock:
    """The bytes of a track in a block of frames: `meshreel_block`."""

    first_frame: U32
    n_frames: U32
    offset: U64
    size_bytes: U64


@dataclass(frozen=True)
class FileGroup:
    """Header of a track in a block: `meshreel_group`."""

    key_block: U32
    """Number of the block whose fields this one uses, which may be this block."""
    n_modes: U32
    """Number of modes; 0 if values are exact, or on a grid."""
    n_corrections: U64
    step: Double
    """Quantization step of the fields, as a fraction of the diagonal."""


@dataclass(frozen=True)
class FileTrack:
    """A quantity that changes over time, `meshreel_track`; `meshreel.h` has the codes."""

    name: String
    unit: String
    kind: U32
    domain: U32
    dtype: NumberType
    n_columns: U32
    n_items: U32
    coding: U32
    is_exact: Flag
    reserved: U32
    bound: Double

    @property
    def error_bound(self) -> float | None:
        """Guaranteed largest error of a value relative to the original; None if there is none."""
        return self.bound or (0.0 if self.is_exact else None)

    @property
    def frame_bytes(self) -> int:
        """Size of the decoded values of one frame."""
        return self.n_items * self.n_columns * self.dtype.itemsize


@dataclass(frozen=True)
class FileModes:
    """A track in a block as a sum of modes.

    The values of frame t of the block, of shape (N, C), are ``origin + fields @ basis[t]`` plus
    corrections of single values. Computed in any order and precision, they differ from decoded
    values by rounding errors only.
    """

    fields: npt.NDArray[np.float64]
    """float array of shape (N, K). In quantization steps; vertices in output order."""
    basis: npt.NDArray[np.float64]
    """float array of shape (T_b, K, C). Includes step and scale."""
    origin: npt.NDArray[np.float64]
    """float array of shape (C,)."""
    correction_starts: npt.NDArray[np.int64]
    """int array of shape (T_b + 1,). Frame t has the corrections
    correction_starts[t]..correction_starts[t + 1] - 1.
    """
    corrected: npt.NDArray[np.int32]
    """int array of shape (n,). Vertex of each correction."""
    corrections: npt.NDArray[np.float64]
    """float array of shape (n, C)."""


def run_tasks(n_threads: int, _: int | None, task: int, shared: int | None, n_tasks: int) -> None:
    """Callback `run` of the host: run tasks 0..n_tasks - 1 of the core on threads, in any order.

    The caller works too, so that a thread that is slow to wake up delays nothing. The tasks call
    neither BLAS nor NumPy, so the threads of BLAS are not limited, unlike in `in_threads`.
    """
    function, numbers = TASK(task), iter(range(n_tasks))

    def work() -> None:
        for number in numbers:  # the interpreter's lock gives each number to one thread
            function(shared, number)

    # A thread of the pool must not wait for another: all of them could wait at once.
    is_pool_thread = threading.current_thread().name.startswith(POOL)
    n_others = 0 if is_pool_thread else min(n_tasks, n_threads) - 1
    others = [pool().submit(work) for _ in range(n_others)]
    try:
        work()
    finally:
        work()  # after an interrupt, finish: the core continues when this returns
        for other in others:
            if not other.cancel():
                other.result()


@cache
def _function(name: str) -> Any:
    function = library()[f"meshreel_{name}"]
    if name in ("close", "end"):
        function.restype = None
    elif name in ("info_of", "triangles", "cells_of", "stored_triangles", "surface_of", "times_of"):
        function.restype = _POINTER
    return function


class FrameDecoder:
    """Decodes frames of a file of `reel`, `lossless` or `grid`; keeps decoded blocks of each track.

    Several threads may share one. A forked child starts with an empty one, because a thread of its
    parent may have been using the blocks. Methods raise as `OpenFile`.

    Parameters
    ----------
    n_modes : int, default 0
        Number of modes of the positions to decode; 0: all.
    """

    def __init__(self, file: "OpenFile", n_modes: int = 0) -> None:
        self._file, self._n_modes = file, n_modes
        self._lock = fork_safe_lock()
        self._process = 0  # id of the process that began the decoder of the core
        self._handle = _POINTER()

    def load(self, block: int, track: int = 0) -> None:
        """Decode a block, unless it is in memory."""
        with self._lock:
            self._begin()
            n_modes = 0 if track else self._n_modes
            self._file.call("load", self._handle, _U32(track), _U32(block), _U32(n_modes))

    def fill(self, out: npt.NDArray[Any], first: int, track: int = 0) -> None:
        """Fill a contiguous array of shape (n, N, C) with frames of a track from `first` on."""
        assert out.flags.c_contiguous
        with self._lock:
            self._begin()
            n_modes = 0 if track else self._n_modes
            arguments = _U32(track), _U32(first), _U32(len(out)), _U32(n_modes)
            address = _POINTER(out.ctypes.data)
            self._file.call("decode", self._handle, *arguments, None, address)

    def modes(self, block: int, track: int = 0) -> FileModes | None:
        """Return the modes of a track in a block.

        None if values need more than a sum: lossless values, values predicted from positions,
        normals, and tracks with missing values or with corrections of values that corners share.
        """
        with self._lock:
            self._begin()
            modes, header = Modes(), self._file.tracks[track]
            arguments = _U32(track), _U32(block)
            self._file.call("modes_of", self._handle, *arguments, ctypes.byref(modes))
            is_sum = modes.n_modes and not modes.has_missing and header.kind != NORMAL
            if not is_sum or (modes.shared and modes.correction_starts):
                return None
            return _file_modes(modes, header.n_items)

    def close(self) -> None:
        """Release the decoded blocks."""
        with self._lock:
            if self._process:
                self._end()
            self._process = 0

    def _begin(self) -> None:
        """Begin the decoder of the core, unless this process has."""
        if self._process != os.getpid():
            self._file.read_mesh()
            self._handle = _POINTER()
            self._file.call("begin", self._file.handle, ctypes.byref(self._handle))
            self._process = os.getpid()
            self._end = finalize(self, _end, self._process, self._file, self._handle)


def _end(process: int, file: "OpenFile", handle: ctypes.c_void_p) -> None:
    if process == os.getpid() and file.is_open:
        _function("end")(handle)


_HostParts = tuple[Host, HostMemory]


def _closer(file: "OpenFile") -> "finalize[[int, _HostParts, ctypes.c_void_p], OpenFile]":
    """Close the file in the core when the object is deleted, or when the result is called."""
    closer = finalize(file, _close, os.getpid(), (file._host, file._memory), file.handle)
    closer.atexit = False
    return closer


def _close(process: int, host: _HostParts, handle: ctypes.c_void_p) -> None:
    """Close a file of the core, which releases memory through `host`."""
    if process == os.getpid():
        _function("close")(handle)


class OpenFile:
    """A `.reel`, or one in an MP4 file, whose container was parsed; the rest is read on demand.

    Several threads may share it.

    Parameters
    ----------
    source : bytes or binary file that can seek
    limit_bytes : float
        Limit of the memory of the file, and of each of its decoders.

    Attributes
    ----------
    info : FileInfo
    times : float64 array of shape (T,), or None
        Time of each frame in seconds; None if they are evenly spaced.
    whole : FileInfo
        Information about the whole file; the same as `info` unless this is a segment.
    source_bytes : int
        Size of the source; in an MP4 file, of its `.reel`.
    offset, first_frame : int
        Byte and frame of the file at which a segment begins; 0 for the first, and for a file.

    Raises
    ------
    CorruptStreamError, TruncatedStreamError
        If the header is damaged, or no block of frames is complete.
    UnsupportedVersionError
        If a newer build is needed.
    MemoryLimitError
        If more memory would be needed than allowed.
    """

    def __init__(self, source: bytes | BinaryIO, limit_bytes: float) -> None:
        self._limit = limit_bytes
        source = source.getvalue() if type(source) is BytesIO else source
        self._memory = HostMemory(*ALLOCATOR)
        self._lock = fork_safe_lock()
        file = BytesIO(source) if isinstance(source, bytes) else source
        self._reader, self._file_bytes = SourceReader(file), file.seek(0, os.SEEK_END)
        part = find_reel(self._reader.bytes_at, self._file_bytes)
        self._reader.start, self.source_bytes = part.start, len(part)
        self._source = source[part.start : part.stop] if isinstance(source, bytes) else None
        n_threads = n_cores()
        self._host = Host(
            ctypes.addressof(self._memory),
            ctypes.cast(library().reel_host_allocate, _POINTER),
            ctypes.cast(library().reel_host_release, _POINTER),
            RUN(partial(run_tasks, n_threads)) if n_threads > 1 else RUN(),
            n_threads,
            0,
            int(min(limit_bytes, 2.0**62)),
        )
        self._handle: ctypes.c_void_p = _POINTER()
        self.is_open: bool = False
        self._has_mesh = False
        read, announce = READ(), ANNOUNCE()
        if self._source is None:
            read, announce = READ(self._reader.read), ANNOUNCE(self._reader.announce)
        self._callbacks = read, announce  # kept, because the core stores their addresses
        core_source = Source(self._source, self.source_bytes, read, None, announce)
        self.call(
            "open",
            ctypes.byref(core_source),
            ctypes.byref(self._host),
            ctypes.byref(self._handle),
        )
        self.is_open = True
        self._close = _closer(self)
        self.info: FileInfo
        self.times: npt.NDArray[np.float64] | None
        self._describe()
        self.whole: FileInfo = self.info
        self.offset = self.first_frame = 0

    @property
    def handle(self) -> ctypes.c_void_p:
        """Address of the file in the core.

        Raises
        ------
        InvalidInputError
            If the file is closed.
        """
        if not self.is_open:
            raise InvalidInputError("the .reel file is closed; open it again")
        return self._handle

    def segment(self, number: int) -> "OpenFile":
        """Open a segment as a separate file whose frames begin at 0; source and memory are shared.

        Raises
        ------
        InvalidInputError
            If the file has no such segment.
        CorruptStreamError, TruncatedStreamError, UnsupportedVersionError, MemoryLimitError
            As for the class, about the segment.
        """
        if not 0 <= number < self.whole.n_segments:
            count = counted(self.whole.n_segments, "segment")
            raise InvalidInputError(
                f"segment {number} is not in the file; it has {count}, numbered from 0"
            )
        entry, segment = self._segment(number), copy(self)
        segment._handle = _POINTER()
        self.call("open_segment", self.handle, _U32(number), ctypes.byref(segment._handle))
        segment._close = _closer(segment)
        segment._describe()
        segment.offset = entry.offset if number else 0
        segment.first_frame = entry.first_frame
        return segment

    @cached_property
    def segments(self) -> tuple[FileSegment, ...]:
        """All segments of a file."""
        return tuple(map(self._segment, range(self.info.n_segments)))

    def _segment(self, number: int) -> FileSegment:
        return self._record(FileSegment, "segment_of", _U32(number))

    def _record(self, record: type[Record], function: str, *arguments: Any) -> Record:
        """Return the record that a function of the core fills; such functions cannot fail."""
        structure = structure_of(record)()
        _function(function)(self.handle, *arguments, ctypes.byref(structure))
        return record_of(record, structure)

    def _describe(self) -> None:
        structure = structure_of(FileInfo).from_address(_function("info_of")(self.handle))
        self.info, address = record_of(FileInfo, structure), _function("times_of")(self.handle)
        self.times = array_at(address, self.info.n_frames, np.float64) if address else None

    def call(self, name: str, *arguments: Any) -> None:
        """Call a function of the core that can fail; the last argument, the error, is added.

        Raises
        ------
        MeshReelError
            The exception for the error code, or the one that reading the source raised.
        """
        error = Error()
        if _function(name)(*arguments, ctypes.byref(error)) != OK:
            raise self.failure(error)

    def failure(self, error: Error) -> BaseException:
        """Return the exception for an error of the core: that of the source if reading failed."""
        source_error = self._reader.failure()
        if error.code == UNREADABLE and source_error is not None:
            return source_error
        if error.code == LIMIT:
            return MemoryLimitError(
                f"decoding would take {size_text(error.size)} of memory; it may take "
                f"{size_text(self._limit)}; if you trust the stream, allow more with ",
                Keyword("memory"),
            )
        if error.code == NO_MEMORY:
            return MemoryError(f"decoding takes {error.size} bytes, which the system does not have")
        return error.exception

    def check(self, frames: range, n_modes: int = 0) -> None:
        """Raise MemoryLimitError if what the mesh and blocks of some frames announce exceeds it.

        Parameters and other errors are those of `FrameDecoder`.
        """
        first, last = sorted((frames[0], frames[-1]))
        arguments = _U32(first), _U32(last - first + 1), _U32(n_modes)
        self.call("check", self.handle, *arguments)

    def read_mesh(self) -> None:
        """Decode the triangles and the order of vertices; raises as the class."""
        with self._lock:
            self.call("read_mesh", self.handle)
        self._has_mesh = True

    @cached_property
    def faces(self) -> Integers:
        """Vertices of each triangle, of shape (M, 3); raises as the class."""
        if not self._has_mesh:
            self.read_mesh()
        address, n_numbers = _function("triangles")(self.handle), 3 * self.info.n_triangles
        return array_at(address, n_numbers, np.int32).reshape(-1, 3)

    @cached_property
    def cells(self) -> tuple[npt.NDArray[np.uint8], Integers] | None:
        """Type of each cell, and the vertices of all cells in order; None without cells."""
        if not self.info.n_cells:
            return None
        self.read_mesh()
        cells = Cells.from_address(_function("cells_of")(self.handle))
        types = array_at(cells.types, cells.n_cells, np.uint8)
        return types, array_at(cells.nodes, cells.n_nodes, np.int32)

    @cached_property
    def stored_mesh(self) -> tuple[Integers, Integers]:
        """Triangles of shape (M, 3) in stored order, and the stored number of each vertex."""
        self.read_mesh()
        order = _POINTER()
        faces = _function("stored_triangles")(self.handle, ctypes.byref(order))
        return (
            array_at(faces, 3 * self.info.n_triangles, np.int32).reshape(-1, 3),
            array_at(order.value, self.info.n_verts, np.int32),
        )

    def surface_address(self) -> int:
        """Decode the surface, and return the address of its `meshreel_surface`."""
        with self._lock:
            self.call("read_surface", self.handle)
        return int(_function("surface_of")(self.handle))

    @cached_property
    def tracks(self) -> tuple[FileTrack, ...]:
        """All tracks; the positions are the first."""
        numbers = range(self.info.n_tracks)
        return tuple(self._record(FileTrack, "track_of", _U32(number)) for number in numbers)

    def block(self, number: int, track: int = 0) -> FileBlock:
        """Return where a track of a block is stored."""
        return self._record(FileBlock, "block_of", _U32(number), _U32(track))

    def block_of_frame(self, frame: int) -> int:
        """Return the number of the block that contains a frame."""
        return int(_function("block_of_frame")(self.handle, _U32(frame)))

    @cached_property
    def blocks(self) -> tuple[FileBlock, ...]:
        """Where the positions of each block are stored."""
        return tuple(map(self.block, range(self.info.n_blocks)))

    @cached_property
    def starts(self) -> list[int]:
        """First frame of each block, then the total number of frames."""
        return [*(block.first_frame for block in self.blocks), self.info.n_frames]

    def group(self, number: int, track: int = 0, *, is_checked: bool = True) -> FileGroup:
        """Return the header of a track in a block; verify its checksums if `is_checked`."""
        group = structure_of(FileGroup)()
        arguments = _U32(number), _U32(track)
        self.call("group_of", self.handle, *arguments, is_checked, ctypes.byref(group))
        return record_of(FileGroup, group)

    def sections(
        self, start: int = 0, stop: int | None = None, *, is_checked: bool = True
    ) -> Iterator[FileSection]:
        """Iterate over the sections from byte `start` to byte `stop`; by default, all."""
        offset, end = start, self.info.size_bytes if stop is None else stop
        while offset < end:
            section = structure_of(FileSection)()
            self.call("section_at", self.handle, _U64(offset), is_checked, ctypes.byref(section))
            yield record_of(FileSection, section)
            offset = section.offset + section.size_bytes

    @cached_property
    def leading(self) -> tuple[FileSection, ...]:
        """Known sections before the first block, those of an earlier segment first."""
        sections: list[FileSection] = []
        section = structure_of(FileSection)()
        address = ctypes.byref(section)
        while not _function("leading_of")(self.handle, _U32(len(sections)), address):
            sections.append(record_of(FileSection, section))
        return tuple(sections)

    def bytes_at(self, offset: int, size: int) -> bytes:
        """Return `size` bytes of the file from `offset` on."""
        return self._reader.bytes_at(self._reader.start + offset, size)

    @property
    def media(self) -> tuple[MediaTrack, ...]:
        """Video and sound beside the `.reel` in an MP4 file; raises as the class."""
        reader = self._reader
        return read_media(reader.bytes_at, self._file_bytes) if reader.start else ()

    @property
    def memory_bytes(self) -> int:
        """Memory of the file, its segments and its decoders, in bytes."""
        return int(self._memory.n_bytes)

    def close(self) -> None:
        """Close the file, and release its memory. Close its decoders first."""
        if self.is_open:
            self.is_open = False
            self._close()


def _file_modes(modes: Modes, n_values: int) -> FileModes:
    n_frames, n_modes, n_columns = modes.n_frames, modes.n_modes, modes.n_columns
    rows = array_at(modes.rows, modes.n_items, np.int32)
    if modes.shared:
        rows = rows[array_at(modes.shared, n_values, np.int32)]
    fields = array_at(modes.values, (rows.max(initial=-1) + 1) * n_modes, np.float64)
    basis = array_at(modes.basis, n_columns * n_frames * n_modes, np.float64)
    basis = basis.reshape(n_columns, n_frames, n_modes).transpose(1, 2, 0)
    n_starts = n_frames + 1 if modes.correction_starts else 0
    starts = array_at(modes.correction_starts, n_starts, np.int64)
    n_corrections = int(starts[-1]) if n_starts else 0
    corrections = array_at(modes.corrections, n_corrections * n_columns, np.float64)
    return FileModes(
        fields.reshape(-1, n_modes)[rows],
        np.ascontiguousarray(basis) * (modes.step * modes.scale),
        array_at(modes.origin, n_columns, np.float64),
        starts if n_starts else np.zeros(n_frames + 1, np.int64),
        array_at(modes.corrected, n_corrections, np.int32),
        corrections.reshape(-1, n_columns) * modes.scale,
    )


def structure_of(record: type) -> type[ctypes.Structure]:
    """Return the C structure whose members are the fields of a dataclass, in order."""
    return _layout_of(record)[0]


def record_of(record: type[Record], structure: ctypes.Structure) -> Record:
    """Copy the members of a structure into its dataclass."""
    members = _layout_of(record)[1].items()
    return record(**{name: _python_value(getattr(structure, name), kind) for name, kind in members})


def _layout_of(record: Any) -> tuple[type[ctypes.Structure], dict[str, Any]]:
    """Return the C structure of a dataclass, and the Python type of each field; cached."""
    if record not in _LAYOUTS:
        hints = get_type_hints(record, include_extras=True)
        members = [(name, annotated.__metadata__[0]) for name, annotated in hints.items()]
        structure = type(record.__name__, (ctypes.Structure,), {"_fields_": members})
        _LAYOUTS[record] = structure, get_type_hints(record)
    return _LAYOUTS[record]


_LAYOUTS: dict[type, tuple[type[ctypes.Structure], dict[str, Any]]] = {}


def _python_value(member: Any, kind: Any) -> Any:
    if isinstance(member, Text):
        return text_of(member)
    if isinstance(member, Error):
        return member.exception if member.code else None
    if isinstance(member, ctypes.Array):
        return tuple(member)
    if kind == np.dtype[Any]:
        return NUMBER_TYPES[member]
    return bool(member) if kind is bool else member


def text_of(text: Text) -> str:
    """Return the string of a `meshreel_text`."""
    return ctypes.string_at(text.bytes, text.size).decode() if text.size else ""


def array_at(address: int | None, count: int, dtype: npt.DTypeLike) -> npt.NDArray[Any]:
    """A read-only copy of an array of the core."""
    array = np.empty(count, dtype)
    if count:
        ctypes.memmove(array.ctypes.data, address or 0, array.nbytes)
    array.flags.writeable = False
    return array
