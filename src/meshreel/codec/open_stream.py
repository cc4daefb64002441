"""An open stream and the parts that its blocks share: mesh, order, surface, time."""

from collections.abc import Collection, Hashable, Iterator
from enum import IntEnum
from functools import cached_property
from operator import attrgetter
from typing import BinaryIO, TypeVar

import numpy as np

from meshreel.codec.bitstream.layout import (
    MESH_SECTIONS,
    SURFACE_SECTIONS,
    Laplacian,
    Order,
    Section,
)
from meshreel.codec.memory import DEFAULT_LIMIT, MemoryLimit
from meshreel.codec.method_names import LOSSLESS, name_of_code
from meshreel.codec.subspace.trajectories import BoundingFrame
from meshreel.codec.surface.decoded import decoded_surface
from meshreel.errors import CorruptStreamError, InvalidInputError, Keyword, UnsupportedVersionError
from meshreel.kernel.files import FileSection, FileTrack, OpenFile
from meshreel.model.surface import PLAIN, Surface
from meshreel.model.timing import Timing

CodedChoice = TypeVar("CodedChoice", bound=IntEnum)


def timing_of(file: OpenFile) -> Timing:
    """Return the timing of a file or a segment."""
    info, times = file.info, file.times
    return Timing(info.fps, info.start_s) if times is None else Timing.of_times(times)


class OpenStream:
    """A stream whose parts are decoded on demand and cached.

    Parameters
    ----------
    source : bytes, binary file that can seek, or OpenFile
    limit : MemoryLimit, optional
        Limit of the mesh, of a block and of a returned array.
    segment : int, optional
        Number of a segment, from 0; needed if the stream has several. Attributes describe it alone.

    Attributes
    ----------
    file : OpenFile
    offset : int
        First byte: 0, or the start of a segment.
    size_bytes : int
        Size up to the end of the stream or segment, or of the last complete block.
    method : str
    laplacian : Laplacian
        Laplacian of the deltas, if the method has deltas.
    order_kept : Order
        The kept order of vertices and faces.
    error_bound_percent : float or None
        Guaranteed error bound, in percent of the diagonal: 0 if positions are those of the
        original, None if the stream guarantees none.
    error_bound : float or None
        The same in model units.
    starts : list of int
        First frame of each complete block, and the number of all frames.
    tracks : tuple of FileTrack
        Tracks other than the positions.

    Raises
    ------
    InvalidInputError
        If the segment does not exist, or the stream has several and none is selected.
    CorruptStreamError, TruncatedStreamError
        If the header is damaged, or no block of frames is complete.
    UnsupportedVersionError
        If a newer build is needed.
    MemoryLimitError
        If even the list of sections takes more memory than allowed.
    """

    def __init__(
        self,
        source: bytes | BinaryIO | OpenFile,
        limit: MemoryLimit = DEFAULT_LIMIT,
        segment: int | None = None,
    ) -> None:
        file = source if isinstance(source, OpenFile) else OpenFile(source, limit.limit_bytes)
        self.file: OpenFile = file if segment is None else file.segment(segment)
        if self.file is not file is not source:
            file.close()
        self.limit = limit
        info, n_segments = self.file.info, self.file.info.n_segments
        if n_segments > 1:
            raise InvalidInputError(
                f"there are {n_segments} segments with different meshes, 0 to {n_segments - 1}; "
                "decode one with ",
                Keyword("segment"),
            )
        self.offset: int = self.file.offset
        self.starts: list[int] = self.file.starts
        self.tracks: tuple[FileTrack, ...] = self.file.tracks[1:]
        self.method: str = name_of_code(info.method)
        self.laplacian: Laplacian = _choice_of_code(Laplacian, info.laplacian)
        self.order_kept: Order = _choice_of_code(Order, info.order)
        self.error_bound_percent: float | None = info.error_bound_percent or (
            0.0 if self.method == LOSSLESS else None
        )
        self.n_frames: int = info.n_frames
        self.n_verts: int = info.n_verts
        self.n_faces: int = info.n_triangles
        self.timing: Timing = timing_of(self.file)
        self.name: str = info.name
        self.is_whole: bool = info.is_whole
        self.size_bytes: int = info.size_bytes - self.offset
        self.dtype: np.dtype[np.floating] = np.dtype(f"f{info.number_bytes}")
        self.frame: BoundingFrame = BoundingFrame(info.center, info.diagonal)
        percent = self.error_bound_percent
        self.error_bound: float | None = None if percent is None else percent / 100 * info.diagonal

    @property
    def n_blocks(self) -> int:
        """Number of complete blocks."""
        return self.file.info.n_blocks

    def require_frames(self, frames: range, n_modes: int | None = None) -> None:
        """Raise MemoryLimitError if some frames, with tracks, announce more than the limit.

        Counts the decoded frames, and the mesh and each block while they are decoded.
        """
        tracks = ", with their tracks," if self.tracks else ""
        subject = f"frames {frames.start}:{frames.stop} of {self.n_verts} vertices{tracks}"
        self.limit.require(self.frames_size_bytes(frames), subject)
        self.file.check(frames, n_modes or 0)

    def frames_size_bytes(self, frames: range) -> int:
        """Bytes of the decoded positions of some frames, and of their tracks."""
        return len(frames) * sum(track.frame_bytes for track in self.file.tracks)

    @property
    def mesh_key(self) -> Hashable:
        """Key of the mesh: equal for segments of a file that share the sections of their mesh."""
        offsets = (section.offset for section in self.file.leading if section.id in MESH_SECTIONS)
        return self.order_kept, *sorted(offsets)

    @cached_property
    def surface(self) -> Surface:
        """Polygons, attributes, groups, hard edges, parts and materials of the mesh."""
        ids = map(attrgetter("id"), self.file.leading)
        is_plain = {Section.CELLS, *SURFACE_SECTIONS}.isdisjoint(ids)
        return PLAIN if is_plain else decoded_surface(self.file)

    def payload(self, section: FileSection) -> bytes:
        """Read the payload of a section."""
        return self.file.bytes_at(section.payload_offset, section.payload_bytes)

    def group(self, number: int, track: int = 0) -> Iterator[tuple[Section, bytes]]:
        """Yield the sections of a track in a block; raises CorruptStreamError if damaged."""
        self.file.group(number, track, is_checked=False)  # raises if sections are misplaced
        block = self.file.block(number, track)
        for section in self.file.sections(block.offset, block.offset + block.size_bytes):
            if section.is_known:
                yield Section(section.id), self.payload(section)


def require_positions(
    file: OpenFile, limit: MemoryLimit, parts: Collection[tuple[int, range]], frames: range
) -> None:
    """Raise MemoryLimitError if positions of several segments alone exceed the limit."""
    n_bytes = sum(12 * len(part) * file.segments[number].n_verts for number, part in parts)
    limit.require(n_bytes, f"frames {frames.start}:{frames.stop} of {len(parts)} segments")


def _choice_of_code(choices: type[CodedChoice], code: int) -> CodedChoice:
    """Return the enumeration member that a stream stores as this code."""
    try:
        return choices(code)
    except ValueError:
        raise UnsupportedVersionError(
            f"{choices.__name__.lower()} {code} is unknown to this build; upgrade meshreel"
        ) from None


def whole_stream(
    data: bytes, limit: MemoryLimit = DEFAULT_LIMIT, segment: int | None = None
) -> OpenStream:
    """Open a complete stream, or a segment of it; one without its end is an error."""
    return OpenStream(whole_file(data, limit), limit, segment)


def whole_file(data: bytes, limit: MemoryLimit = DEFAULT_LIMIT) -> OpenFile:
    """Open a complete stream of any number of segments; one without its end is an error."""
    file = OpenFile(data, limit.limit_bytes)
    require_whole(file)
    return file


def require_whole(file: OpenFile) -> None:
    """Raise an error if the end of a file is missing or damaged; as `whole_file`."""
    if file.info.damage is not None:
        raise file.info.damage
    if file.info.size_bytes != file.source_bytes:
        raise CorruptStreamError(
            f"{file.source_bytes - file.info.size_bytes} bytes follow the end marker of the stream"
        )
