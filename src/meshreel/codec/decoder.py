"""Decode a stream to a mesh sequence."""

from collections.abc import Hashable, Iterator
from concurrent.futures import Future
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.codec.memory import MemoryLimit, memory_limit
from meshreel.codec.open_stream import OpenStream, whole_file, whole_stream
from meshreel.codec.reel_track import tracks_of_stream
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.kernel.files import OpenFile
from meshreel.model.frame_choice import frame_range, start_of
from meshreel.model.segments import SegmentedSequence
from meshreel.model.sequence import Faces, MeshSequence
from meshreel.model.surface import Surface
from meshreel.model.tracks import Track
from meshreel.runtime.progress import Count, Progress, silent
from meshreel.runtime.threads import results_in_order

Mesh = tuple[Surface, Faces]

FRAMES_PER_REPORT = 256
"""Most frames between two progress reports."""

FACE_BYTES = 12

SMALL_POSITIONS = 1 << 20
"""Segments of up to this many positions are decoded in parallel, larger ones one at a time."""


def decode(
    data: bytes,
    *,
    frames: slice | None = None,
    n_modes: int | None = None,
    segment: int | None = None,
    memory: float | str | None = None,
    progress: Progress = silent,
) -> MeshSequence:
    """Return the sequence, or a range of its frames, that a `.reel` stream contains.

    Parameters
    ----------
    data : bytes
        A complete stream, from `encode` or a file.
    frames : slice, optional
        Frames to return, as a Python slice without a step; only the blocks that contain some of
        them are decoded. Default: all.
    n_modes : int, optional
        Number of leading modes of each block to use: a coarser animation. Default: all. In streams
        of `reel` further modes, up to the 16th at least, keep their mean over the block, and
        corrections are omitted. The paper's methods omit further rows of coefficients (the paper's
        k_l). Streams of `lossless` and `grid` have no modes.
    segment : int, optional
        Number of a segment, from 0; needed if the stream has several.
    memory : float or str, optional
        Upper limit for the frames and tracks together, for the mesh, and for a block while they
        are decoded: bytes, or text such as "2GiB". Default: 8 GiB.
    progress : callable, optional
        Called with the stage and the completed share, 0..1.

    Raises
    ------
    InvalidInputError
        If `frames` selects no frame or has a step, `n_modes` is below 1 or the stream has no modes,
        `segment` does not exist, or the stream has several segments and none is selected.
    CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
        If the bytes are not a complete stream that this build reads.
    MemoryLimitError
        If decoding needs more memory than the limit; raised before the memory is allocated.
    """
    limit = memory_limit(memory)
    progress("decoding connectivity", 0.0)
    opened = whole_stream(bytes(data), limit, segment)
    opened.require_mesh()
    selected = frame_range(frames, opened.n_frames)
    start_s = start_of(selected, opened.start_s, opened.fps)
    return _decode_frames(opened, selected, start_s, n_modes, progress)


def decode_segments(
    data: bytes,
    *,
    frames: slice | None = None,
    n_modes: int | None = None,
    memory: float | str | None = None,
    progress: Progress = silent,
) -> SegmentedSequence:
    """Return the segments of a `.reel` stream, or those of a range of frames; one at least.

    Parameters and errors are those of `decode`.
    """
    limit = memory_limit(memory)
    progress("decoding connectivity", 0.0)
    file = whole_file(bytes(data), limit)
    requested = frame_range(frames, file.info.n_frames)
    segments: list[MeshSequence] = []
    needed_bytes = n_decoded = 0

    def parts() -> Iterator[_Part]:
        nonlocal needed_bytes
        for part in _parts(file, limit, requested):
            needed_bytes += part.size_bytes
            stop = part.first_frame + part.frames.stop
            limit.require(
                needed_bytes, f"frames {requested.start}:{stop} of {part.number + 1} segments"
            )
            yield part

    def decode_one(part: _Part) -> tuple[_Part, MeshSequence]:
        return part, part.decode(n_modes)

    def is_small(part: _Part) -> bool:
        return file.info.n_segments > 1 and part.n_positions <= SMALL_POSITIONS

    for part, segment in results_in_order(decode_one, parts(), is_small):
        needed_bytes += segment.surface.size_bytes if part.has_new_mesh else 0
        n_decoded += segment.n_frames
        segments.append(segment)
        progress("decoding", Count(n_decoded, len(requested), "frames"))
    return SegmentedSequence(segments)


@dataclass(frozen=True)
class _Part:
    """Frames of a segment, and the number and first frame of the segment in the stream.

    `mesh` is pending until the first segment with this mesh is decoded: the one with
    `has_new_mesh`.
    """

    opened: OpenStream
    frames: range
    number: int
    first_frame: int
    mesh: Future[Mesh]
    has_new_mesh: bool

    @property
    def n_positions(self) -> int:
        return len(self.frames) * self.opened.n_verts

    @property
    def size_bytes(self) -> int:
        """Size of the decoded frames, tracks and new faces."""
        faces_bytes = FACE_BYTES * self.opened.n_faces if self.has_new_mesh else 0
        return self.opened.frames_size_bytes(self.frames) + faces_bytes

    def decode(self, n_modes: int | None) -> MeshSequence:
        start_s = start_of(self.frames, self.opened.start_s, self.opened.fps)
        mesh = None if self.has_new_mesh else self.mesh.result()
        try:
            decoded = _decode_frames(self.opened, self.frames, start_s, n_modes, silent, mesh)
        except BaseException as error:
            if self.has_new_mesh:
                self.mesh.set_exception(error)
            raise
        if self.has_new_mesh:
            self.mesh.set_result((decoded.surface, decoded.faces))
        return decoded


def _parts(file: OpenFile, limit: MemoryLimit, requested: range) -> Iterator[_Part]:
    """Yield the requested frames of each segment."""
    meshes: dict[Hashable, Future[Mesh]] = {}
    for number, place in enumerate(file.segments):
        first = max(requested.start, place.first_frame)
        stop = min(requested.stop, place.first_frame + place.n_frames)
        if first < stop:
            opened = OpenStream(file, limit, number)
            opened.require_mesh()
            frames = range(first - place.first_frame, stop - place.first_frame)
            has_new_mesh = opened.mesh_key not in meshes
            mesh = meshes.setdefault(opened.mesh_key, Future())
            yield _Part(opened, frames, number, place.first_frame, mesh, has_new_mesh)


def _decode_frames(
    opened: OpenStream,
    selected: range,
    start_s: float,
    n_modes: int | None,
    progress: Progress,
    mesh: Mesh | None = None,
) -> MeshSequence:
    """Return some frames of an open stream of one segment, with their tracks.

    `mesh` is that of another segment, if both store the same.
    """
    reader = opened.method.frames(opened, n_modes)
    tracks = tracks_of_stream(opened, reader)
    opened.require_frames(selected, with_tracks=True)
    vertices = np.empty((len(selected), opened.n_verts, 3), opened.dtype)
    values: list[npt.NDArray[Any]] = []
    for track in tracks.values():
        values.append(np.empty((len(selected), *track.shape[1:]), track.dtype))
    for block, (start, stop) in enumerate(pairwise(opened.starts)):
        first, last = max(start, selected.start), min(stop, selected.stop)
        if first >= last:
            continue
        reader.load(block)
        # The reader holds this block until the next one: decode its tracks now.
        for number, out in enumerate(values, start=1):
            reader.fill(out[first - selected.start : last - selected.start], first, number)
        for begin in range(first, last, FRAMES_PER_REPORT):
            end = min(begin + FRAMES_PER_REPORT, last)
            reader.fill(vertices[begin - selected.start : end - selected.start], begin)
            progress("decoding", Count(end - selected.start, len(selected), "frames"))
    try:
        surface, faces = mesh or (opened.surface, opened.file.faces)
        reader.close()
        opened.file.close()
        decoded: dict[str, Track] = {}
        for track, out in zip(tracks.values(), values, strict=True):
            decoded[track.name] = Track(out, track.domain, track.kind, track.unit)
        return MeshSequence.of_finite(
            vertices,
            faces,
            opened.fps,
            opened.name,
            start_s,
            surface,
            decoded,
        )
    except InvalidInputError as error:
        raise CorruptStreamError(f"the stream decodes to an invalid mesh: {error}") from error
