"""3ds Max point caches (``.pc2``): float32 positions, without faces.

The header (32 bytes, little endian) has the signature, version 1, the number of vertices, the first
frame, the interval between samples in frames, and the number of samples. There is no frame rate.
"""

import math
import struct
from pathlib import Path

import numpy as np

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.caches.point_cache import (
    FRAME_RATE,
    cache_reader,
    check_cache_size,
    read_topology,
    single_precision,
)
from meshreel.formats.file_errors import errors_naming, os_errors_naming
from meshreel.formats.frames.array_frames import ArrayFrames, Description
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.options import ReadOptions, WriteOptions
from meshreel.model.sequence import FrameSource

SIGNATURE = b"POINTCACHE2\0"
VERSION = 1
HEADER = struct.Struct("<12siiffi")


def open_pc2(path: Path, options: ReadOptions) -> FrameSource:
    """Open the sequence of a ``.pc2`` file.

    Its name is the file stem; the frame rate is that of the options, or unknown.
    """
    with errors_naming(path):
        n_verts, first_frame, interval, n_frames = _read_header(path)
    faces, surface = read_topology(path, n_verts, options)
    fps = options.fps or 0.0
    if interval != 1:
        options.notes.append(f"samples are {interval:g} frames apart; each is read as one frame")
    if first_frame and not fps:
        options.notes.append(
            f"begins at frame {first_frame:g} of unknown rate, which is read as 0 s; set the rate "
            "with --fps (fps=)"
        )
    start_s = first_frame / (fps * interval) if fps else 0.0
    read = cache_reader(path, HEADER.size, n_verts, "<f4")
    frames = ArrayFrames(path, n_frames, n_verts, np.dtype(np.float32), read)
    return frames.open(Description(faces, fps, path.stem, start_s, surface), options, {})


def write_pc2(path: Path, stream: FrameStream, options: WriteOptions) -> None:
    """Write a ``.pc2`` file; notes report what it cannot store exactly."""
    first_frame = _first_frame(stream)
    header = HEADER.pack(SIGNATURE, VERSION, stream.n_verts, first_frame, 1.0, stream.n_frames)
    with path.open("wb") as file:
        file.write(header)
        for frame in single_precision(stream):
            file.write(frame.astype("<f4", copy=False).tobytes())


def _first_frame(stream: FrameStream) -> float:
    """Return the start as a frame number; adds notes if it will be read back differently."""
    fps = stream.fps or FRAME_RATE
    with np.errstate(over="ignore"):
        first_frame = float(np.float32(stream.start_s * fps))
    if not math.isfinite(first_frame):
        raise InvalidInputError(
            f"start_s of {stream.start_s:g} is too large for PC2, which stores float32"
        )
    if stream.fps:
        stream.notes.append(
            f"PC2 has no frame rate: set {stream.fps:g} fps when reading it (--fps)"
        )
    if first_frame / fps != stream.start_s or (stream.start_s and not stream.fps):
        stream.notes.append(
            f"PC2 stores the start at {stream.start_s!r} s as frame {first_frame:g} at "
            f"{fps:g} fps, which is {first_frame / fps!r} s"
        )
    return first_frame


def _read_header(path: Path) -> tuple[int, float, float, int]:
    """Read the number of vertices, first frame, interval in frames, and number of samples."""
    with os_errors_naming(path), path.open("rb") as file:
        data, size_bytes = file.read(HEADER.size), path.stat().st_size
    if len(data) < HEADER.size or data[:12] != SIGNATURE:
        raise FormatError(f"is not a PC2 file: it begins with {data[:12]!r}, not {SIGNATURE!r}")
    _, version, n_verts, first_frame, interval, n_frames = HEADER.unpack(data)
    if version != VERSION:
        raise FormatError(f"has PC2 version {version}; version {VERSION} is supported")
    if not (math.isfinite(first_frame) and math.isfinite(interval) and interval > 0):
        raise FormatError(f"is damaged: begins at frame {first_frame} at intervals of {interval}")
    check_cache_size(HEADER.size, n_frames, n_verts, size_bytes)
    return n_verts, first_frame, interval, n_frames
