"""Binding of the core's decoder of `.reel` files, `core/include/meshreel.h`."""

import ctypes
import os
import threading
from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass
from functools import cache, cached_property, partial
from io import BytesIO
from typing import Any, BinaryIO
from weakref import finalize

import numpy as np
import numpy.typing as npt

from meshreel.errors import (
    CorruptStreamError,
    InvalidInputError,
    MemoryLimitError,
    TruncatedStreamError,
    UnsupportedVersionError,
)
from meshreel.kernel.host import (
    ANNOUNCE,
    READ,
    RUN,
    TASK,
    HostMemory,
    SourceReader,
    block_store,
)
from meshreel.kernel.library import library
from meshreel.kernel.structures import (
    CORRUPT,
    LIMIT,
    NO_MEMORY,
    NORMAL,
    NUMBER_TYPES,
    OK,
    TRUNCATED,
    UNKNOWN_BYTE,
    UNREADABLE,
    UNSUPPORTED,
    Block,
    Error,
    Group,
    Host,
    Info,
    Modes,
    Section,
    Segment,
    Source,
    Text,
    Track,
)
from meshreel.runtime.counting import counted, size_text
from meshreel.runtime.threads import POOL, fork_safe_lock, n_cores, pool

Integers = npt.NDArray[np.int32]

_U32, _U64, _POINTER = ctypes.c_uint32, ctypes.c_uint64, ctypes.c_void_p


@dataclass(frozen=True)
class FileInfo:
    """Contents of the header and the index of a file or a segment.

    Attributes
    ----------
    error_bound_percent : float or None
        Guaranteed bound of the displacement of vertices, in percent of the diagonal, or None.
    center : tuple of 3 floats
    diagonal : float
        Of the bounding box of all frames, in model units.
    size_bytes : int
        Up to the end of the file, or of the last complete block.
    n_frames, n_verts, n_triangles, n_faces, n_corners, n_blocks, n_tracks : int
        The positions are among the tracks.
    number_bytes, method, laplacian, order : int
        As in the header.
    n_segments : int
        Of a file of several, `error_bound_percent` is None and all counts but `n_frames` are 0.
    damage : Exception or None
        Why it is not whole.
    """

    name: str
    fps: float
    start_s: float
    error_bound_percent: float | None
    center: tuple[float, float, float]
    diagonal: float
    size_bytes: int
    n_frames: int
    n_verts: int
    n_triangles: int
    n_faces: int
    n_corners: int
    n_blocks: int
    n_tracks: int
    number_bytes: int
    method: int
    laplacian: int
    order: int
    n_segments: int
    is_whole: bool
    damage: Exception | None


@dataclass(frozen=True)
class FileSegment:
    """A mesh of constant connectivity in a file, and its frames.

    Attributes
    ----------
    first_frame : int
        Its number in the file.
    offset, size_bytes : int
        Of its bytes, without the header of the file.
    """

    first_frame: int
    n_frames: int
    n_verts: int
    n_triangles: int
    offset: int
    size_bytes: int


@dataclass(frozen=True)
class FileSection:
    """A section of a file: its id, its bytes, and those of its payload."""

    id: int
    is_known: bool
    offset: int
    size_bytes: int
    payload_offset: int
    payload_bytes: int


@dataclass(frozen=True)
class FileBlock:
    """The bytes of a track in a block of frames."""

    first_frame: int
    n_frames: int
    offset: int
    size_bytes: int


@dataclass(frozen=True)
class FileGroup:
    """Header of a track in a block.

    Attributes
    ----------
    key_block : int
        The block whose fields it refers to, or itself.
    n_modes : int
        0: values are stored exactly.
    step : float
        Quantization step of the fields, in diagonals.
    """

    key_block: int
    n_modes: int
    n_corrections: int
    step: float


@dataclass(frozen=True)
class FileTrack:
    """A quantity that changes over time; `core/include/meshreel.h` has the codes."""

    name: str
    unit: str
    kind: int
    domain: int
    dtype: np.dtype[Any]
    n_columns: int
    n_items: int
    coding: int
    is_exact: bool
    bound: float

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

    Attributes
    ----------
    fields : float array of shape (N, K)
        In quantization steps; vertices in output order.
    basis : float array of shape (T_b, K, C)
        Includes step and scale.
    origin : float array of shape (C,)
    correction_starts : int array of shape (T_b + 1,)
        Frame t has the corrections correction_starts[t]..correction_starts[t + 1] - 1.
    corrected : int array of shape (n,)
        Corrected vertex of each.
    corrections : float array of shape (n, C)
    """

    fields: npt.NDArray[np.float64]
    basis: npt.NDArray[np.float64]
    origin: npt.NDArray[np.float64]
    correction_starts: npt.NDArray[np.int64]
    corrected: npt.NDArray[np.int32]
    corrections: npt.NDArray[np.float64]


def run_tasks(n_threads: int, _: int | None, task: int, shared: int | None, n_tasks: int) -> None:
    """Call tasks 0..n_tasks - 1 of the core on some threads, in any order: `run` of the host.

    The caller takes part, so that a thread that is slow to wake up delays nothing. The tasks call
    neither BLAS nor NumPy, so BLAS keeps its threads, unlike in `in_threads`.
    """
    function, numbers = TASK(task), iter(range(n_tasks))

    def work() -> None:
        for number in numbers:  # the interpreter's lock gives each number to one thread
            function(shared, number)

    # A thread of the pool must not wait for another: all of them could wait at once.
    is_alone = threading.current_thread().name.startswith(POOL)
    n_others = 0 if is_alone else min(n_tasks, n_threads) - 1
    others = [pool().submit(work) for _ in range(n_others)]
    try:
        work()
    finally:
        work()  # what an interrupt left: the core continues when this returns
        for other in others:
            if not other.cancel():
                other.result()


@cache
def _function(name: str) -> Any:
    function = library()[f"meshreel_{name}"]
    if name in ("close", "end"):
        function.restype = None
    elif name in ("info_of", "triangles", "stored_triangles", "surface_of"):
        function.restype = _POINTER
    return function


class FrameDecoder:
    """Decodes frames of a file of `reel`, `lossless` or `grid`; it holds blocks of each track.

    Several threads may share one. A forked child starts over: a thread of its parent may have been
    using what is held.

    Parameters
    ----------
    n_modes : int, default 0
        Only the first so many modes of positions move; 0: all.
    """

    def __init__(self, file: "OpenFile", n_modes: int = 0) -> None:
        self._file, self._n_modes = file, n_modes
        self._lock = fork_safe_lock()
        self._process = 0  # that began the decoder of the core
        self._handle = _POINTER()

    def load(self, block: int, track: int = 0) -> None:
        """Load a block, unless it is held; raises as `fill`."""
        with self._lock:
            self._begin()
            n_modes = 0 if track else self._n_modes
            self._file.call("load", self._handle, _U32(track), _U32(block), _U32(n_modes))

    def fill(self, out: npt.NDArray[Any], first: int, track: int = 0) -> None:
        """Fill a contiguous array of shape (n, N, C) with frames of a track from `first` on.

        Raises
        ------
        CorruptStreamError, TruncatedStreamError
            If a block is damaged.
        MemoryLimitError
            If a block takes more memory than allowed.
        """
        assert out.flags.c_contiguous
        with self._lock:
            self._begin()
            n_modes = 0 if track else self._n_modes
            numbers = _U32(track), _U32(first), _U32(len(out)), _U32(n_modes)
            address = _POINTER(out.ctypes.data)
            self._file.call("decode", self._handle, *numbers, None, address)

    def modes(self, block: int, track: int = 0) -> FileModes | None:
        """Return the modes of a track in a block.

        None if values need more than a sum: lossless values, values predicted from positions,
        normals, and tracks with missing values or with corrections of values that corners share.

        Raises
        ------
        CorruptStreamError, TruncatedStreamError
            If the block is damaged.
        MemoryLimitError
            If it takes more memory than allowed.
        """
        with self._lock:
            self._begin()
            found = Modes()
            number, stored = (_U32(track), _U32(block)), self._file.tracks[track]
            self._file.call("modes_of", self._handle, *number, ctypes.byref(found))
            is_sum = found.n_modes and not found.has_missing and stored.kind != NORMAL
            if not is_sum or (found.shared and found.correction_starts):
                return None
            return _file_modes(found, stored.n_items)

    def close(self) -> None:
        """Release all that is held."""
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


_Kept = tuple[Host, HostMemory]


def _closer(file: "OpenFile") -> "finalize[[int, _Kept, ctypes.c_void_p], OpenFile]":
    """Close the file in the core when the object is deleted, or when the result is called."""
    closer = finalize(file, _close, os.getpid(), (file._host, file._memory), file.handle)
    closer.atexit = False
    return closer


def _close(process: int, kept: _Kept, handle: ctypes.c_void_p) -> None:
    """Close a file of the core, which releases its memory: its host must still exist."""
    if process == os.getpid():
        _function("close")(handle)


class OpenFile:
    """A `.reel` file whose container was parsed; mesh and surface are decoded on demand.

    Several threads may share it.

    Parameters
    ----------
    source : bytes or binary file that can seek
    limit_bytes : float
        That the file, and each of its decoders, may hold.

    Attributes
    ----------
    info : FileInfo
    whole : FileInfo
        Of the file that a segment is part of; else as `info`.
    offset, first_frame : int
        Byte and frame of the whole at which it begins: 0 but of a segment behind the first.

    Raises
    ------
    CorruptStreamError, TruncatedStreamError
        If the header is damaged, or no block of frames is complete.
    UnsupportedVersionError
        If a newer build is needed.
    MemoryLimitError
        If more memory would be held than allowed.
    """

    def __init__(self, source: bytes | BinaryIO, limit_bytes: float) -> None:
        self._limit = limit_bytes
        self._source = source = source.getvalue() if type(source) is BytesIO else source
        self._memory = HostMemory(ctypes.pointer(block_store()))
        self._lock = fork_safe_lock()
        self._reader = None if isinstance(source, bytes) else SourceReader(source)
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
        self.handle: ctypes.c_void_p = _POINTER()
        self.is_open: bool = False
        self._has_mesh = False
        self.call(
            "open",
            ctypes.byref(self._core_source()),
            ctypes.byref(self._host),
            ctypes.byref(self.handle),
        )
        self.is_open = True
        self._close = _closer(self)
        self.info: FileInfo = self._info()
        self.whole: FileInfo = self.info
        self.offset = self.first_frame = 0

    def segment(self, number: int) -> "OpenFile":
        """A segment as a separate file, whose frames begin at 0; source and memory are shared.

        Raises
        ------
        InvalidInputError
            If the file has no such segment.
        CorruptStreamError, TruncatedStreamError, UnsupportedVersionError, MemoryLimitError
            As the class, of the segment.
        """
        if not 0 <= number < self.whole.n_segments:
            there = counted(self.whole.n_segments, "segment")
            raise InvalidInputError(
                f"segment {number} is not in the file; it has {there}, numbered from 0"
            )
        place, found = self._segment(number), copy(self)
        found.handle = _POINTER()
        self.call("open_segment", self.handle, _U32(number), ctypes.byref(found.handle))
        found._close = _closer(found)
        found.info = found._info()
        found.offset = place.offset if number else 0
        found.first_frame = place.first_frame
        return found

    @cached_property
    def segments(self) -> tuple[FileSegment, ...]:
        """All segments of a file."""
        return tuple(map(self._segment, range(self.info.n_segments)))

    def _segment(self, number: int) -> FileSegment:
        found = Segment()
        _function("segment_of")(self.handle, _U32(number), ctypes.byref(found))
        return FileSegment(
            found.first_frame,
            found.n_frames,
            found.n_verts,
            found.n_triangles,
            found.offset,
            found.size,
        )

    def _core_source(self) -> Source:
        if isinstance(self._source, bytes):
            return Source(self._source, len(self._source), READ(), None, ANNOUNCE())
        assert self._reader is not None
        size = self._source.seek(0, os.SEEK_END)
        # Kept: the core copies their addresses.
        self._callbacks = READ(self._reader.read), ANNOUNCE(self._reader.announce)
        read, announce = self._callbacks
        return Source(None, size, read, None, announce)

    def _info(self) -> FileInfo:
        found = ctypes.cast(_function("info_of")(self.handle), ctypes.POINTER(Info)).contents
        damage = found.damage
        numbers = "fps start_s diagonal n_frames n_verts n_triangles n_faces n_corners n_blocks"
        codes = "n_tracks number_bytes method laplacian order n_segments"
        return FileInfo(
            name=text_of(found.name),
            error_bound_percent=found.error_bound_percent or None,
            center=tuple(found.center),
            size_bytes=found.size,
            is_whole=bool(found.is_whole),
            damage=_stream_error(damage) if damage.code else None,
            **{name: getattr(found, name) for name in f"{numbers} {codes}".split()},
        )

    def call(self, name: str, *arguments: Any) -> None:
        """Call a function of the core that can fail; the last argument, the error, is added.

        Raises
        ------
        MeshReelError
            By its code; or what the file raised when it was read.
        """
        error = Error()
        if _function(name)(*arguments, ctypes.byref(error)) != OK:
            raise self.failure(error)

    def failure(self, error: Error) -> BaseException:
        """The exception for an error of the core; what the file raised if it was read."""
        raised = None if self._reader is None else self._reader.failure()
        if error.code == UNREADABLE and raised is not None:
            return raised
        if error.code == LIMIT:
            return MemoryLimitError(
                f"decoding would take {size_text(error.size)} of memory; it may take "
                f"{size_text(self._limit)}; if you trust the stream, allow more with memory="
            )
        if error.code == NO_MEMORY:
            return MemoryError(f"decoding takes {error.size} bytes, which the system does not have")
        return _stream_error(error)

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
        found = array_at(_function("triangles")(self.handle), 3 * self.info.n_triangles, np.int32)
        return found.reshape(-1, 3)

    @cached_property
    def stored_mesh(self) -> tuple[Integers, Integers]:
        """Triangles of shape (M, 3) as they are stored, and the stored number of each vertex."""
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
        return tuple(self._track(number) for number in range(self.info.n_tracks))

    def _track(self, number: int) -> FileTrack:
        found = Track()
        _function("track_of")(self.handle, _U32(number), ctypes.byref(found))
        return FileTrack(
            text_of(found.name),
            text_of(found.unit),
            found.kind,
            found.domain,
            NUMBER_TYPES[found.type],
            found.n_columns,
            found.n_items,
            found.coding,
            bool(found.is_exact),
            found.bound,
        )

    def block(self, number: int, track: int = 0) -> FileBlock:
        """The bytes of a track in a block."""
        found = Block()
        _function("block_of")(self.handle, _U32(number), _U32(track), ctypes.byref(found))
        return FileBlock(found.first_frame, found.n_frames, found.offset, found.size)

    def block_of_frame(self, frame: int) -> int:
        """The block that holds a frame."""
        return int(_function("block_of_frame")(self.handle, _U32(frame)))

    @cached_property
    def blocks(self) -> tuple[FileBlock, ...]:
        """The bytes of the positions in each block."""
        return tuple(map(self.block, range(self.info.n_blocks)))

    @cached_property
    def starts(self) -> list[int]:
        """First frame of each block, and the number of all frames."""
        return [*(one.first_frame for one in self.blocks), self.info.n_frames]

    def group(self, number: int, track: int = 0, *, is_checked: bool = True) -> FileGroup:
        """What a block says of a track; its checksums are compared if `is_checked`."""
        found = Group()
        self.call(
            "group_of", self.handle, _U32(number), _U32(track), is_checked, ctypes.byref(found)
        )
        return FileGroup(found.key_block, found.n_modes, found.n_corrections, found.step)

    def sections(
        self, start: int = 0, stop: int | None = None, *, is_checked: bool = True
    ) -> Iterator[FileSection]:
        """Sections from a byte on, by default the first, up to another, by default the end.

        Raises
        ------
        CorruptStreamError, TruncatedStreamError
            If one is damaged.
        """
        offset, end = start, self.info.size_bytes if stop is None else stop
        while offset < end:
            found = Section()
            self.call("section_at", self.handle, _U64(offset), is_checked, ctypes.byref(found))
            yield _file_section(found)
            offset = found.offset + found.size

    @cached_property
    def leading(self) -> tuple[FileSection, ...]:
        """Known sections before the first block, those that an earlier segment stores first."""
        sections: list[FileSection] = []
        found = Section()
        while not _function("leading_of")(self.handle, _U32(len(sections)), ctypes.byref(found)):
            sections.append(_file_section(found))
        return tuple(sections)

    def bytes_at(self, offset: int, size: int) -> bytes:
        """Bytes of the file."""
        if self._reader is not None:
            return self._reader.bytes_at(offset, size)
        assert isinstance(self._source, bytes)
        return self._source[offset : offset + size]

    @property
    def held_bytes(self) -> int:
        """Memory that the file, its segments and its decoders hold."""
        return int(self._memory.n_bytes)

    def close(self) -> None:
        """Release what the file holds, after its decoders."""
        if self.is_open:
            self.is_open = False
            self._close()


def _file_modes(found: Modes, n_values: int) -> FileModes:
    n_frames, n_modes, n_columns = found.n_frames, found.n_modes, found.n_columns
    rows = array_at(found.rows, found.n_items, np.int32)
    if found.shared:
        rows = rows[array_at(found.shared, n_values, np.int32)]
    fields = array_at(found.values, (rows.max(initial=-1) + 1) * n_modes, np.float64)
    basis = array_at(found.basis, n_columns * n_frames * n_modes, np.float64)
    basis = basis.reshape(n_columns, n_frames, n_modes).transpose(1, 2, 0)
    n_starts = n_frames + 1 if found.correction_starts else 0
    starts = array_at(found.correction_starts, n_starts, np.int64)
    n_corrections = int(starts[-1]) if n_starts else 0
    corrections = array_at(found.corrections, n_corrections * n_columns, np.float64)
    return FileModes(
        fields.reshape(-1, n_modes)[rows],
        np.ascontiguousarray(basis) * (found.step * found.scale),
        array_at(found.origin, n_columns, np.float64),
        starts if n_starts else np.zeros(n_frames + 1, np.int64),
        array_at(found.corrected, n_corrections, np.int32),
        corrections.reshape(-1, n_columns) * found.scale,
    )


def _file_section(found: Section) -> FileSection:
    return FileSection(
        found.id,
        bool(found.is_known),
        found.offset,
        found.size,
        found.payload,
        found.payload_size,
    )


def _stream_error(error: Error) -> Exception:
    """The exception of a failure of the core."""
    kinds: dict[int, type[Exception]] = {
        TRUNCATED: TruncatedStreamError,
        CORRUPT: CorruptStreamError,
        UNSUPPORTED: UnsupportedVersionError,
    }
    message = error.message.decode()
    place = "" if error.offset == UNKNOWN_BYTE else f" (byte {error.offset})"
    return kinds.get(error.code, InvalidInputError)(f"{message}{place}")


def text_of(text: Text) -> str:
    """The string of a text of the core."""
    return ctypes.string_at(text.bytes, text.size).decode() if text.size else ""


def array_at(address: int | None, count: int, dtype: npt.DTypeLike) -> npt.NDArray[Any]:
    """A copy of an array of the core."""
    found = np.empty(count, dtype)
    if count:
        ctypes.memmove(found.ctypes.data, address or 0, found.nbytes)
    return found
