"""Decode a stream to a mesh sequence."""

from collections.abc import Hashable, Iterator
from dataclasses import dataclass
from itertools import islice, pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.codec.memory import MemoryLimit, memory_limit
from meshreel.codec.methods import FrameReader, method_named
from meshreel.codec.open_stream import OpenStream, timing_of, whole_file
from meshreel.codec.surface.codes import DOMAINS
from meshreel.codec.tracks import KINDS
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.kernel.files import OpenFile
from meshreel.kernel.parts import SegmentFrames, decode_together
from meshreel.model.frame_choice import frame_range
from meshreel.model.sequence import Faces, MeshSequence, frames_by_segment
from meshreel.model.surface import Surface
from meshreel.model.tracks import Track
from meshreel.runtime.progress import Count, Progress, silent

Mesh = tuple[Surface, Faces]

FRAMES_PER_REPORT = 256
"""Maximum number of frames between two progress reports."""

FACE_BYTES = 12

POSITIONS_OF_GROUP = 1 << 20
"""Consecutive segments of up to this many positions together are decoded on one thread each."""


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

    Parameters and errors are those of `meshreel.decode`, without files.
    """
    limit = memory_limit(memory)
    progress("decoding connectivity", 0.0)
    file = whole_file(bytes(data), limit)
    if segment is not None:
        file = file.segment(segment)
    if file.info.n_segments > 1:
        selected = frame_range(frames, file.info.n_frames)
        segments = _segments(file, selected, n_modes, limit, progress)
        return MeshSequence.of_segments(segments, timing=timing_of(file).part(selected))
    opened = OpenStream(file, limit)
    opened.require_mesh()
    selected = frame_range(frames, opened.n_frames)
    part = _Part(opened, selected)
    return _decode_parts([part], n_modes, {}, progress)[0]


def _segments(
    file: OpenFile, requested: range, n_modes: int | None, limit: MemoryLimit, progress: Progress
) -> list[MeshSequence]:
    """Decode the requested frames of each segment that contains any."""
    segments: list[MeshSequence] = []
    meshes: dict[Hashable, Mesh] = {}
    needed_bytes = 0

    def parts() -> Iterator[_Part]:
        nonlocal needed_bytes
        keys: set[Hashable] = set()
        starts = *(place.first_frame for place in file.segments), file.info.n_frames
        for number, selected in frames_by_segment(starts, requested):
            opened = OpenStream(file, limit, number)
            opened.require_mesh()
            key = opened.mesh_key
            needed_bytes += opened.frames_size_bytes(selected)
            has_new_mesh = key not in keys
            needed_bytes += FACE_BYTES * opened.n_faces if has_new_mesh else 0
            keys.add(key)
            stop = starts[number] + selected.stop
            limit.require(needed_bytes, f"frames {requested.start}:{stop} of {number + 1} segments")
            yield _Part(opened, selected, key, has_new_mesh)

    for group in _groups(parts()):
        n_meshes = len(meshes)
        segments += _decode_parts(group, n_modes, meshes, silent)
        new_meshes = islice(meshes.values(), n_meshes, None)
        needed_bytes += sum(surface.size_bytes for surface, _ in new_meshes)
        n_decoded = sum(segment.n_frames for segment in segments)
        progress("decoding", Count(n_decoded, len(requested), "frames"))
    return segments


@dataclass(frozen=True)
class _Part:
    """Frames of an open stream of one segment.

    Parts with the same `mesh_key` have the same mesh, which is decoded for the first of them.
    """

    opened: OpenStream
    frames: range
    mesh_key: Hashable = None
    has_new_mesh: bool = True


def _groups(parts: Iterator[_Part]) -> Iterator[list[_Part]]:
    """Yield parts in order, small ones together."""
    group: list[_Part] = []
    n_positions = 0
    for part in parts:
        n_part = len(part.frames) * part.opened.n_verts
        if group and n_positions + n_part > POSITIONS_OF_GROUP:
            yield group
            group, n_positions = [], 0
        group.append(part)
        n_positions += n_part
    yield group


def _decode_parts(
    parts: list[_Part], n_modes: int | None, meshes: dict[Hashable, Mesh], progress: Progress
) -> list[MeshSequence]:
    """Decode a single part on all threads, or each of several on one; closes their streams.

    `meshes` are those of earlier segments by their keys; new ones are added.
    """
    readers: list[FrameReader] = []
    arrays: list[list[npt.NDArray[Any]]] = []  # positions, and values of each track
    for part in parts:
        opened, n_frames = part.opened, len(part.frames)
        readers.append(method_named(opened.method).frames(opened, n_modes))
        opened.require_frames(part.frames)
        arrays.append([])
        for track in opened.file.tracks:
            shape = n_frames, track.n_items, track.n_columns
            arrays[-1].append(np.empty(shape, track.dtype))
    if len(parts) > 1:
        decode_together(
            [
                SegmentFrames(
                    part.opened.file,
                    part.frames.start,
                    values,
                    n_modes or 0,
                    part.has_new_mesh and part.opened.has_surface,
                )
                for part, values in zip(parts, arrays, strict=True)
            ]
        )
    else:
        (reader,), (values,), selected = readers, arrays, parts[0].frames
        for block, (start, stop) in enumerate(pairwise(opened.starts)):
            first, last = max(start, selected.start), min(stop, selected.stop)
            if first >= last:
                continue
            reader.load(block)
            # The reader holds this block until the next one: decode its tracks now.
            for number, out in enumerate(values[1:], start=1):
                reader.fill(out[first - selected.start : last - selected.start], first, number)
            for begin in range(first, last, FRAMES_PER_REPORT):
                end = min(begin + FRAMES_PER_REPORT, last)
                reader.fill(values[0][begin - selected.start : end - selected.start], begin)
                progress("decoding", Count(end - selected.start, n_frames, "frames"))
    sequences: list[MeshSequence] = []
    for part, reader, (vertices, *values) in zip(parts, readers, arrays, strict=True):
        opened = part.opened
        try:
            if part.has_new_mesh:
                meshes[part.mesh_key] = opened.surface, opened.file.faces
            surface, faces = meshes[part.mesh_key]
            reader.close()
            opened.file.close()
            tracks: dict[str, Track] = {}
            for track, out in zip(opened.tracks, values, strict=True):
                kind, domain = KINDS[track.kind], DOMAINS[track.domain]
                tracks[track.name] = Track(out, domain, kind, track.unit)
            sequences.append(
                MeshSequence.of_finite(
                    vertices,
                    faces,
                    opened.name,
                    opened.timing.part(part.frames),
                    surface,
                    tracks,
                )
            )
        except InvalidInputError as error:
            raise CorruptStreamError(f"the stream decodes to an invalid mesh: {error}") from error
    return sequences
