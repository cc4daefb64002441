"""Point caches: positions in float32 without faces, which come from a separate mesh file.

3ds Max (``.pc2``): the header (32 bytes, little endian) has the signature, version 1, the number of
vertices, the first frame, the interval between samples in frames, and the number of samples. There
is no frame rate.

LightWave (``.mdd``): all numbers are big endian: the number of frames and vertices, the time of
each frame in seconds, and the positions of each frame.
"""

import math
import struct
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError, InvalidInputError, Keyword, Message
from meshreel.formats.file_errors import (
    check_input_file,
    errors_naming,
    os_errors_naming,
    read_bytes,
)
from meshreel.formats.frames.frame_stream import FrameStream, SegmentedStream
from meshreel.formats.frames.stored_frames import Description, RawArray
from meshreel.formats.kinds import SequenceFormat
from meshreel.formats.options import Reading, WriteOptions
from meshreel.formats.registry import COMPANION, FRAME_FORMATS
from meshreel.formats.surfaces.polygons import triangulated
from meshreel.model.notes import ASSUMED_FPS, Notes, written_times
from meshreel.model.sequence import Faces, FrameSource, Vertices
from meshreel.model.surface import Surface
from meshreel.model.timing import Timing
from meshreel.runtime.counting import counted

VERTEX_BYTES = 12

PC2_SIGNATURE, PC2_VERSION = b"POINTCACHE2\0", 1
PC2_HEADER = struct.Struct("<12siiffi")
PC2_NUMBER = np.dtype("<f4")
MDD_HEADER = struct.Struct(">ii")
MDD_NUMBER = np.dtype(">f4")


def open_pc2(path: Path, reading: Reading) -> FrameSource:
    """Open the sequence of a ``.pc2`` file.

    Its name is the file stem; the frame rate is that of the options, or unknown.
    """
    with errors_naming(path):
        n_verts, first_frame, interval, n_frames = _read_pc2_header(path)
    faces, surface = read_topology(path, n_verts, reading)
    fps = reading.fps or 0.0
    if interval != 1:
        text = f"samples are {interval:g} frames apart; each is read as one frame"
        reading.notes.changed("samples", text)
    if first_frame and not fps:
        text = Message(
            f"begins at frame {first_frame:g} of unknown rate, which is read as 0 s; set the rate "
            "with ",
            Keyword("fps"),
        )
        reading.notes.unknown("start", text)
    start_s = first_frame / (fps * interval) if fps else 0.0
    positions = RawArray(path, PC2_HEADER.size, (n_frames, n_verts, 3), PC2_NUMBER)
    description = Description(faces, path.stem, Timing.of_rate(fps, start_s), surface)
    return description.open_array(positions, {}, reading.max_loaded_bytes, reading.progress)


def write_pc2(path: Path, segments: SegmentedStream, options: WriteOptions) -> None:
    """Write a ``.pc2`` file; notes report what it cannot store exactly."""
    stream = segments.only()
    first_frame = _first_frame(stream)
    header = PC2_HEADER.pack(
        PC2_SIGNATURE, PC2_VERSION, stream.n_verts, first_frame, 1.0, stream.n_frames
    )
    with path.open("wb") as file:
        file.write(header)
        for frame in single_precision(stream):
            file.write(frame.astype("<f4", copy=False).tobytes())


def _first_frame(stream: FrameStream) -> float:
    """Return the start as a frame number; adds notes if it will be read back differently."""
    timing = stream.timing
    fps, start_s = timing.fps or ASSUMED_FPS, timing.start_s
    with np.errstate(over="ignore"):
        first_frame = float(np.float32(start_s * fps))
    if not math.isfinite(first_frame):
        raise InvalidInputError(
            f"start_s of {start_s:g} is too large for PC2, which stores float32"
        )
    if timing.fps:
        lost_value = "frame rate" if timing.times is None else "frame times"
        text = f"PC2 has no {lost_value}: set {fps:g} fps when reading it ("
        advice = Message(text, Keyword("fps"), ")")
        stream.notes.unwritten("frame rate", advice)
    if first_frame / fps != start_s or (start_s and not timing.fps):
        text = (
            f"PC2 stores the start at {start_s!r} s as frame {first_frame:g} at "
            f"{fps:g} fps, which is {first_frame / fps!r} s"
        )
        stream.notes.changed("start", text)
    return first_frame


def _read_pc2_header(path: Path) -> tuple[int, float, float, int]:
    """Read the number of vertices, first frame, interval in frames, and number of samples."""
    with os_errors_naming(path), path.open("rb") as file:
        data, size_bytes = file.read(PC2_HEADER.size), path.stat().st_size
    if len(data) < PC2_HEADER.size or data[:12] != PC2_SIGNATURE:
        raise FormatError(f"is not a PC2 file: it begins with {data[:12]!r}, not {PC2_SIGNATURE!r}")
    _, version, n_verts, first_frame, interval, n_frames = PC2_HEADER.unpack(data)
    if version != PC2_VERSION:
        raise FormatError(f"has PC2 version {version}; version {PC2_VERSION} is supported")
    if not (math.isfinite(first_frame) and math.isfinite(interval) and interval > 0):
        raise FormatError(f"is damaged: begins at frame {first_frame} at intervals of {interval}")
    check_cache_size(PC2_HEADER.size, n_frames, n_verts, size_bytes)
    return n_verts, first_frame, interval, n_frames


def open_mdd(path: Path, reading: Reading) -> FrameSource:
    """Open the sequence of an ``.mdd`` file; its name is the file stem."""
    with errors_naming(path):
        n_verts, times = _read_mdd_header(path)
    faces, surface = read_topology(path, n_verts, reading)
    timing = _timing(times)
    if (np.diff(times) <= 0).any():
        text = "frame times are not ascending; the frame rate is unknown"
        reading.notes.unknown("frame rate", text)
    timing = timing.at_rate(reading.fps or None)
    start_byte = MDD_HEADER.size + times.nbytes
    positions = RawArray(path, start_byte, (len(times), n_verts, 3), MDD_NUMBER)
    description = Description(faces, path.stem, timing, surface)
    return description.open_array(positions, {}, reading.max_loaded_bytes, reading.progress)


def write_mdd(path: Path, segments: SegmentedStream, options: WriteOptions) -> None:
    """Write an ``.mdd`` file; notes report what it cannot store exactly."""
    stream = segments.only()
    with np.errstate(over="ignore"):
        times = written_times(stream.timing, stream.n_frames, stream.notes).astype(MDD_NUMBER)
    if not np.isfinite(times).all():
        raise InvalidInputError(
            f"start_s of {stream.timing.start_s:g} is too large for MDD, which stores float32"
        )
    _note_times(times, stream)
    with path.open("wb") as file:
        file.write(MDD_HEADER.pack(stream.n_frames, stream.n_verts) + times.tobytes())
        for frame in single_precision(stream):
            file.write(frame.astype(">f4").tobytes())


def _note_times(times: npt.NDArray[Any], stream: FrameStream) -> None:
    """Add notes if frame rate or start will be read back with another value."""
    rounded_timing, timing = _timing(times), stream.timing
    if timing.times is not None:
        if not np.array_equal(times, timing.times):
            text = "MDD stores times as float32, to which these are rounded"
            stream.notes.changed("frame times", text)
        return
    if timing.fps and stream.n_frames == 1:
        text = f"MDD has no frame rate for one frame: {timing.fps:g} fps is lost"
        stream.notes.unwritten("frame rate", text)
    elif timing.fps and rounded_timing.fps != timing.fps:
        text = f"MDD stores times as float32: {timing.fps!r} fps reads as {rounded_timing.fps!r}"
        stream.notes.changed("frame rate", text)
    if rounded_timing.start_s != timing.start_s:
        text = (
            f"MDD stores times as float32: the start at {timing.start_s!r} s reads as "
            f"{rounded_timing.start_s!r} s"
        )
        stream.notes.changed("start", text)


def _timing(times: npt.NDArray[Any]) -> Timing:
    """Infer frame rate and start that round to the given float32 times, if possible; the rate is
    unknown if they do not ascend.

    Starts at a whole frame number are preferred, then the shortest decimal of the first time (0.1
    rather than 0.10000000149).
    """
    decimal_start_s = float(str(np.float32(times[0])))
    if (np.diff(times) <= 0).any():
        return Timing(0.0, decimal_start_s)
    timing = Timing.of_times(times.astype(np.float32))
    rates = dict.fromkeys([timing.fps, round(timing.fps, 2), round(timing.fps, 3)])
    rates.pop(0.0, None)
    whole_frame_starts = [(fps, round(float(times[0]) * fps) / fps) for fps in rates]
    for fps, start_s in whole_frame_starts + [(fps, decimal_start_s) for fps in rates]:
        if np.array_equal(_times(fps, start_s, len(times)), times):
            return Timing(fps, start_s)
    return timing if timing.times is not None else Timing(timing.fps, decimal_start_s)


def _times(fps: float, start_s: float, n_frames: int) -> npt.NDArray[Any]:
    with np.errstate(over="ignore"):
        return (start_s + np.arange(n_frames) / fps).astype(MDD_NUMBER)


def _read_mdd_header(path: Path) -> tuple[int, npt.NDArray[Any]]:
    """Read the number of vertices and the frame times."""
    with os_errors_naming(path), path.open("rb") as file:
        head, size_bytes = file.read(MDD_HEADER.size), path.stat().st_size
        if len(head) < MDD_HEADER.size:
            raise FormatError(f"is not an MDD file: it has only {size_bytes} bytes")
        n_frames, n_verts = MDD_HEADER.unpack(head)
        check_cache_size(
            MDD_HEADER.size + MDD_NUMBER.itemsize * n_frames, n_frames, n_verts, size_bytes
        )
        times = np.frombuffer(file.read(MDD_NUMBER.itemsize * n_frames), MDD_NUMBER)
    if not np.isfinite(times).all():
        raise FormatError("is damaged: frame times are not finite")
    return n_verts, times


def check_cache_size(header_bytes: int, n_frames: int, n_verts: int, size_bytes: int) -> None:
    """Reject a point cache whose size contradicts its header.

    Raises
    ------
    FormatError
        If the sizes differ; the message gives both.
    """
    if n_frames < 1 or n_verts < 1:
        raise FormatError(f"declares {counted(n_frames, 'frame')} of {counted(n_verts, 'vertex')}")
    expected_bytes = header_bytes + n_frames * n_verts * VERTEX_BYTES
    if size_bytes != expected_bytes:
        problem = "is truncated" if size_bytes < expected_bytes else "is damaged"
        raise FormatError(
            f"{problem}: {counted(n_frames, 'frame')} of {counted(n_verts, 'vertex')} take "
            f"{expected_bytes} bytes; "
            f"the file has {size_bytes}"
        )


def single_precision(stream: FrameStream) -> Iterator[Vertices]:
    """Yield each frame in float32; a note reports the rounding error, if any.

    Raises
    ------
    InvalidInputError
        If a frame exceeds float32; the message names it.
    """
    max_error = 0.0
    for index, frame in enumerate(stream.frames()):
        with np.errstate(over="ignore", under="ignore"):
            rounded: Vertices = frame.astype(np.float32, copy=False)
        if rounded is not frame:
            if not np.isfinite(rounded).all():
                raise InvalidInputError(
                    f"frame {index} has coordinates up to {np.abs(frame).max():g}; point caches "
                    "store float32, up to 3.4e38; scale the model down"
                )
            max_error = max(max_error, float(np.abs(rounded - frame).max()))
        yield rounded
    if max_error > 0:
        text = f"positions were rounded to float32, by up to {max_error:.3g}"
        stream.notes.changed("positions", text)


def read_topology(cache: Path, n_verts: int, reading: Reading) -> tuple[Faces, Surface]:
    """Return the triangles and the surface for a point cache with `n_verts` vertices.

    They come from the mesh file of the options, or from the mesh file next to the cache with the
    same name.

    Raises
    ------
    InvalidInputError
        If there is no such mesh, or its number of vertices differs.
    FormatError
        If the mesh has a format without shared vertices, or is damaged.
    """
    path = reading.topology or cache.with_suffix(COMPANION)
    if reading.topology is None and not path.is_file():
        raise InvalidInputError(
            f"{cache} has positions of {counted(n_verts, 'vertex')} without faces; give the mesh "
            "file with the faces by ",
            Keyword("topology", "mesh.obj"),
            f", or store it as {path.name} in the same folder",
        )
    mesh_format = FRAME_FORMATS.get(path.suffix.lower())
    if mesh_format is None or mesh_format.has_unshared_vertices:
        extensions = [
            entry.extension for entry in FRAME_FORMATS.values() if not entry.has_unshared_vertices
        ]
        raise FormatError(
            f"the faces of a point cache must be in a {', '.join(extensions)} file", path=path
        )
    check_input_file(path)
    data = read_bytes(path)
    with errors_naming(path):
        frame = mesh_format.read(data)
    mesh, notes = frame.mesh, Notes(frame.notes)
    surface = frame.surface_with_edges(notes)
    attributes = {(attribute.domain, attribute.name) for attribute in surface.attributes}
    notes.left_out("fields", (key[1] for key in frame.fields if key not in attributes))
    reading.notes.add_all(notes)
    if len(mesh.vertices) != n_verts:
        raise InvalidInputError(
            f"{cache} has {counted(n_verts, 'vertex')} and {path} {len(mesh.vertices)}; "
            "use the mesh that the cache was created from"
        )
    faces = triangulated(mesh, reading.notes)
    return faces, replace(surface, face_sizes=mesh.counts.astype(np.int32))


FORMATS = tuple(
    SequenceFormat(
        extension,
        title,
        open_cache,
        write_cache,
        read_options=frozenset({"topology"}),
        companion=COMPANION,
    )
    for extension, title, open_cache, write_cache in (
        (".pc2", "point cache of 3ds Max", open_pc2, write_pc2),
        (".mdd", "point cache of LightWave", open_mdd, write_mdd),
    )
)
