"""Writing a sequence to an Alembic file, frame by frame."""

import math
import os
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from meshreel.arrays import Floats
from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.alembic.library import (
    NOT_IN_NAMES,
    NOT_IN_TEXTS,
    UNNAMED,
    clean,
    clean_unique_name,
    load_imath,
)
from meshreel.formats.alembic.meshes import read_meshes
from meshreel.formats.alembic.part_writer import PartWriter
from meshreel.formats.frames.frame_stream import FrameStream, SegmentedStream
from meshreel.formats.frames.shared_data import SharedData
from meshreel.formats.kinds import VERTEX_FACE_CORNER, SequenceFormat
from meshreel.formats.options import WriteOptions
from meshreel.formats.scenes.parts import split_parts
from meshreel.formats.scenes.transforms import Rounding
from meshreel.model.notes import note_name, note_unwritten_tracks, written_rate, written_times
from meshreel.model.tracks import value_range
from meshreel.runtime.extras import ALEMBIC

SAMPLE_OVERHEAD_BYTES = 256
"""Bound on the overhead of a part in a frame, in addition to its positions; 124 bytes measured."""
PART_OVERHEAD_BYTES = 1 << 14
"""Bound on headers and names of a part; about 1.5 kB measured."""

MAX_INT32 = np.iinfo(np.int32).max

ObjectPath = tuple[str, ...]
"""Names from the root down."""


def object_paths(names: Sequence[str]) -> list[ObjectPath]:
    """Return a path for each part, unique and below at least one transform.

    A part name that is a path becomes the path of its mesh. A path that has a single component,
    or is also the parent of another part, gains a transform of the same name, as in Blender:
    "body" becomes "/body/body".
    """
    requested = [
        tuple(clean(component, NOT_IN_NAMES) for component in name.split("/") if component)
        or (UNNAMED,)
        for name in names
    ]
    transforms = {path[:depth] for path in requested for depth in range(1, len(path))}
    transforms |= {path for path in requested if len(path) == 1}
    used = set(transforms)
    paths = []
    for path in requested:
        mesh_path = (*path, path[-1]) if path in transforms else path
        siblings = {other[-1] for other in used if other[:-1] == mesh_path[:-1]}
        paths.append((*mesh_path[:-1], clean_unique_name(mesh_path[-1], siblings)))
        used.add(paths[-1])
    return paths


def write_alembic(path: Path, stream: SegmentedStream, options: WriteOptions) -> None:
    """Write an Alembic file (Ogawa) with one polygon mesh per part.

    Float32 positions, polygons and attributes are lossless; notes name everything else. If the
    faces change, faces, attributes and groups are sampled in every frame. One frame is in memory
    at a time.

    Raises
    ------
    FormatError
        If the library is not installed, or cannot write the file.
    InvalidInputError
        If the disk is too small, or a position does not fit into float32.
    """
    shared = SharedData.of(stream.meshes())
    shared.note_others(".abc", stream.notes)
    stream = stream.map_segments(shared.restrict)
    check_free_space(path, stream)
    try:
        rounding = _write_archive(path, stream, shared)
    except RuntimeError as error:  # from the Alembic library
        raise FormatError(
            f"the Alembic library cannot write {path.name}: {' '.join(str(error).split())}"
        ) from None
    rounding.note(stream.notes)


def _write_archive(path: Path, stream: SegmentedStream, shared: SharedData) -> Rounding:
    """Write a file, which is complete once the library's objects are destroyed."""
    archive, core = ALEMBIC.load("Abc").OArchive(str(path)), ALEMBIC.load("AbcCoreAbstract")
    timing = stream.timing
    if timing.times is not None or (stream.n_frames == 1 and not timing.fps):
        times = core.TimeVector()
        for time in written_times(timing, stream.n_frames, stream.notes).tolist():
            times.append(time)
        kind = core.TimeSamplingType(core.AcyclicFlag.kAcyclic)
        time_sampling = core.TimeSampling(kind, times)
    else:
        rate = written_rate(timing, stream.notes)
        time_sampling = core.TimeSampling(1 / rate, timing.start_s)
    sampling = archive.addTimeSampling(time_sampling)

    left_out = unwritable_tracks(stream, shared)
    rounding: Rounding | None = None
    writers: list[PartWriter] = []
    for segment in stream.segments():
        tracks = {name: track for name, track in segment.tracks.items() if name not in left_out}
        parts = list(split_parts(segment.faces, segment.surface, segment.n_verts, stream.name))
        if rounding is None:
            rounding = Rounding(segment.first, "Alembic")
            for part in parts:
                note_name("part", part.name, clean(part.name, NOT_IN_TEXTS), ".abc", stream.notes)
            segment_data = shared if stream.n_segments > 1 else None
            transforms: dict[ObjectPath, Any] = {(): archive.getTop()}
            mesh_paths = object_paths([part.name for part in parts])
            for part, (*parents, name) in zip(parts, mesh_paths, strict=True):
                parent = _transform(transforms, tuple(parents), rounding.shift)
                mesh = ALEMBIC.load("AbcGeom").OPolyMesh(parent, name, sampling)
                schema = mesh.getSchema()
                writers.append(
                    PartWriter(schema, part, sampling, tracks, segment.notes, segment_data)
                )
        for writer, part in zip(writers, parts, strict=True):
            writer.begin(part)
        for index, frame in enumerate(segment.frames()):
            rounded = rounding.add(frame)
            values = {name: track.read(index, index + 1)[0] for name, track in tracks.items()}
            for writer in writers:
                writer.add(rounded, values)
    assert rounding is not None  # there is at least one segment
    return rounding


def _transform(transforms: dict[ObjectPath, Any], path: ObjectPath, shift: Floats) -> Any:
    """Return the transform at a path, created if it is missing; those at the top are shifted."""
    if path not in transforms:
        geometry, parent = ALEMBIC.load("AbcGeom"), _transform(transforms, path[:-1], shift)
        transform, sample = geometry.OXform(parent, path[-1]), geometry.XformSample()
        if len(path) == 1 and shift.any():
            sample.setTranslation(load_imath().V3d(*shift.tolist()))
        transform.getSchema().set(sample)
        transforms[path] = transform
    return transforms[path]


def unwritable_tracks(stream: SegmentedStream, shared: SharedData) -> set[str]:
    """Return the names of tracks that Alembic cannot store; notes of the stream name them."""
    long_names = {
        str(name) for name, *_, number_type, _ in shared.tracks if number_type[1:] in ("i8", "u8")
    }
    too_large = {
        name: None
        for mesh in (stream.meshes() if long_names else ())
        for name, track in mesh.tracks.items()
        if name in long_names
        and any((abs(limit) > MAX_INT32).any() for limit in value_range(track))
    }
    note_unwritten_tracks(
        too_large, ".abc", stream.notes, "integers beyond 32 bits (a limit of its library)"
    )
    return set(too_large)


def check_free_space(path: Path, stream: SegmentedStream) -> None:
    """Check that the disk has enough space: the library aborts the process on a full disk.

    The space is allocated once and freed, so that quotas and file size limits count too.

    Raises
    ------
    InvalidInputError
        If there is less space than the file may need.
    """
    max_bytes = sum(map(_max_file_bytes, stream.meshes()))
    try:
        if hasattr(os, "posix_fallocate"):
            with tempfile.TemporaryFile(dir=path.parent) as file:
                os.posix_fallocate(file.fileno(), 0, max_bytes)
        is_free, reason = shutil.disk_usage(path.parent).free >= max_bytes, "the disk is too full"
    except OSError as error:
        is_free, reason = False, str(error.strerror)
    if not is_free:
        raise InvalidInputError(
            f"{path.name} needs up to {max_bytes} bytes as an Alembic file, but there is not "
            f"enough space ({reason}); write it to another disk"
        )


def _max_file_bytes(mesh: FrameStream) -> int:
    """Return an upper bound on the size of a segment in an Alembic file."""
    surface = mesh.surface
    n_parts = max(1, len(surface.parts))
    n_corners = 3 * len(mesh.faces)
    constant_bytes = 4 * (n_corners + len(mesh.faces)) + 4 * surface.size_bytes
    n_numbers = sum(math.prod(track.shape[1:]) for track in mesh.tracks.values())
    n_sampled = len(surface.attributes) + sum(1 + len(group.labels) for group in surface.groups)
    n_arrays = n_parts * (1 + len(mesh.tracks) + n_sampled)
    if surface.hard_edges is not None:
        n_numbers += 3 * n_corners
    frame_bytes = 12 * mesh.n_verts + 8 * n_numbers + SAMPLE_OVERHEAD_BYTES * n_arrays
    return int(constant_bytes + frame_bytes * mesh.n_frames + PART_OVERHEAD_BYTES * n_arrays)


FORMATS = (
    SequenceFormat(
        ".abc",
        "Alembic",
        read_meshes=read_meshes,
        extra=ALEMBIC,
        reads_without_extra=True,
        write=write_alembic,
        holds_segments=True,
        track_domains=VERTEX_FACE_CORNER,
    ),
)
