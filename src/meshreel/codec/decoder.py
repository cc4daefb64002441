"""Decode a stream to a mesh sequence."""

from collections.abc import Hashable, Iterator
from concurrent.futures import Future
from io import BytesIO
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.codec.memory import MemoryLimit, memory_limit
from meshreel.codec.methods import method_named
from meshreel.codec.open_stream import OpenStream, require_positions, timing_of, whole_file
from meshreel.codec.reel_file import ReelFile
from meshreel.codec.surface.codes import DOMAINS
from meshreel.codec.tracks import KINDS
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.kernel.files import OpenFile
from meshreel.model.frame_choice import frame_range
from meshreel.model.sequence import Faces, MeshSequence, frames_by_segment
from meshreel.model.surface import Surface
from meshreel.model.tracks import Track
from meshreel.runtime.progress import Count, Progress, silent
from meshreel.runtime.threads import results_in_order

Mesh = tuple[Surface, Faces]

FRAMES_PER_REPORT = 256
"""Maximum number of frames between two progress reports."""

FACE_BYTES = 12

TINY_POSITIONS, SMALL_POSITIONS = 1 << 10, 1 << 20
"""Segments with numbers of positions between these are coded in parallel. Larger ones are coded one
at a time on all cores; tiny ones one at a time on one, since their threads would mostly wait for
the interpreter's lock."""


def decode(
    data: bytes,
    *,
    frames: slice | None = None,
    n_modes: int | None = None,
    segment: int | None = None,
    memory: float | str | None = None,
    progress: Progress = silent,
) -> MeshSequence:
    """Return the sequence, or some of its frames, that a `.reel` stream contains.

    Parameters and errors are those of `meshreel.decode`, without files.
    """
    limit = memory_limit(memory)
    progress("decoding connectivity", 0.0)
    file = whole_file(bytes(data), limit)
    if isinstance(frames, slice) and frames.step not in (None, 1):
        with ReelFile(BytesIO(data), n_modes, memory, segment) as reel:
            return reel[frames]
    if segment is not None:
        file = file.segment(segment)
    if file.info.n_segments > 1:
        selected = frame_range(frames, file.info.n_frames)
        segments = _segments(file, selected, n_modes, limit, progress)
        return MeshSequence.of_segments(segments, timing=timing_of(file).part(selected))
    opened = OpenStream(file, limit)
    selected = frame_range(frames, opened.n_frames)
    return _Part(opened, selected, n_modes, Future(), has_new_mesh=True).decode(progress)


def _segments(
    file: OpenFile, requested: range, n_modes: int | None, limit: MemoryLimit, progress: Progress
) -> list[MeshSequence]:
    """Decode the requested frames of each segment that contains any."""
    segments: list[MeshSequence] = []
    needed_bytes = n_decoded = 0

    def parts() -> Iterator[_Part]:
        nonlocal needed_bytes
        meshes: dict[Hashable, Future[Mesh]] = {}
        starts = *(entry.first_frame for entry in file.segments), file.info.n_frames
        selections = [*frames_by_segment(starts, requested)]
        require_positions(file, limit, selections, requested)
        for number, selected in selections:
            opened = OpenStream(file, limit, number)
            has_new_mesh = opened.mesh_key not in meshes
            mesh = meshes.setdefault(opened.mesh_key, Future())
            needed_bytes += opened.frames_size_bytes(selected)
            needed_bytes += FACE_BYTES * opened.n_faces if has_new_mesh else 0
            stop = starts[number] + selected.stop
            limit.require(needed_bytes, f"frames {requested.start}:{stop} of {number + 1} segments")
            yield _Part(opened, selected, n_modes, mesh, has_new_mesh=has_new_mesh)

    def decode_one(part: _Part) -> tuple[_Part, MeshSequence]:
        return part, part.decode(silent)

    for part, segment in results_in_order(decode_one, parts(), _is_parallel):
        surface = segment.surface
        needed_bytes += surface.size_bytes + surface.image_bytes if part.has_new_mesh else 0
        n_decoded += segment.n_frames
        segments.append(segment)
        progress("decoding", Count(n_decoded, len(requested), "frames"))
    return segments


class _Part:
    """Frames of an open stream of one segment.

    `mesh` is pending until the first part with this mesh is decoded, the one with `has_new_mesh`.
    """

    def __init__(
        self,
        opened: OpenStream,
        frames: range,
        n_modes: int | None,
        mesh: Future[Mesh],
        *,
        has_new_mesh: bool,
    ) -> None:
        self.opened, self.frames = opened, frames
        self.has_new_mesh = has_new_mesh
        self._mesh = mesh
        self._has_fewer_modes = n_modes is not None
        self._reader = method_named(opened.method).frames(opened, n_modes)
        opened.require_frames(frames, n_modes)

    def decode(self, progress: Progress) -> MeshSequence:
        """Decode the frames with their tracks, and close the stream."""
        try:
            return self._decode(progress)
        except BaseException as error:
            if self.has_new_mesh and not self._mesh.done():
                self._mesh.set_exception(error)  # for parts that wait for this mesh
            raise

    def _decode(self, progress: Progress) -> MeshSequence:
        opened = self.opened
        vertices, *values = self._decode_values(progress)
        try:
            if self.has_new_mesh:
                self._mesh.set_result((opened.surface, opened.file.faces))
            surface, faces = self._mesh.result()
            self._reader.close()
            opened.file.close()
            tracks: dict[str, Track] = {}
            for track, out in zip(opened.tracks, values, strict=True):
                kind, domain = KINDS[track.kind], DOMAINS[track.domain]
                tracks[track.name] = Track(out, domain, kind, track.unit, track.error_bound)
            timing = opened.timing.part(self.frames)
            return MeshSequence.of_finite(
                vertices,
                faces,
                opened.name,
                timing,
                surface,
                tracks,
                None if self._has_fewer_modes else opened.error_bound,
            )
        except InvalidInputError as error:
            raise CorruptStreamError(f"the stream decodes to an invalid mesh: {error}") from error

    def _decode_values(self, progress: Progress) -> list[npt.NDArray[Any]]:
        """Return the positions, and the values of each track."""
        reader, selected = self._reader, self.frames
        positions, *values = (
            np.empty((len(selected), track.n_items, track.n_columns), track.dtype)
            for track in self.opened.file.tracks
        )
        for block, (start, stop) in enumerate(pairwise(self.opened.starts)):
            first, last = max(start, selected.start), min(stop, selected.stop)
            if first >= last:
                continue
            reader.load(block)
            # The reader caches this block until the next one: decode its tracks now.
            for number, out in enumerate(values, start=1):
                reader.fill(out[first - selected.start : last - selected.start], first, number)
            for begin in range(first, last, FRAMES_PER_REPORT):
                end = min(begin + FRAMES_PER_REPORT, last)
                reader.fill(positions[begin - selected.start : end - selected.start], begin)
                progress("decoding", Count(end - selected.start, len(selected), "frames"))
        for array in (positions, *values):
            array.flags.writeable = False  # so that the sequence keeps it without a copy
        return [positions, *values]


def _is_parallel(part: _Part) -> bool:
    return TINY_POSITIONS < len(part.frames) * part.opened.n_verts <= SMALL_POSITIONS
