"""LightWave point caches (``.mdd``): times and float32 positions, without faces.

Big endian throughout: number of frames, number of vertices, time of each frame in seconds, and the
positions of each frame.
"""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

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
from meshreel.formats.scenes.timing import FrameTimes, frame_times
from meshreel.model.sequence import FrameSource

HEADER = struct.Struct(">ii")
TIME = np.dtype(">f4")


def open_mdd(path: Path, options: ReadOptions) -> FrameSource:
    """Open the sequence of an ``.mdd`` file; its name is the file stem."""
    with errors_naming(path):
        n_verts, times = _read_header(path)
    faces, surface = read_topology(path, n_verts, options)
    timing = _timing(times)
    if (np.diff(times) <= 0).any():
        timing = FrameTimes(0.0, timing.start_s, is_even=True)
        options.notes.append("frame times are not ascending; the frame rate is unknown")
    elif not timing.is_even:
        options.notes.append(f"frame times are uneven; read as {timing.fps:g} frames per second")
    read = cache_reader(path, HEADER.size + times.nbytes, n_verts, ">f4")
    frames = ArrayFrames(path, len(times), n_verts, np.dtype(np.float32), read)
    fps = options.fps or timing.fps
    about = Description(faces, fps, path.stem, timing.start_s, surface)
    return frames.open(about, options, {})


def write_mdd(path: Path, stream: FrameStream, options: WriteOptions) -> None:
    """Write an ``.mdd`` file; notes report what it cannot store exactly."""
    times = _times(stream.fps or FRAME_RATE, stream.start_s, stream.n_frames)
    if not np.isfinite(times).all():
        raise InvalidInputError(
            f"start_s of {stream.start_s:g} is too large for MDD, which stores float32"
        )
    _note_times(times, stream)
    with path.open("wb") as file:
        file.write(HEADER.pack(stream.n_frames, stream.n_verts) + times.tobytes())
        for frame in single_precision(stream):
            file.write(frame.astype(">f4").tobytes())


def _note_times(times: npt.NDArray[Any], stream: FrameStream) -> None:
    """Add notes if frame rate or start will be read back with another value."""
    found = _timing(times)
    if not stream.fps:
        stream.notes.append(f"the frame rate is unknown; written as {FRAME_RATE:g} fps")
    elif stream.n_frames == 1:
        stream.notes.append(f"MDD has no frame rate for one frame: {stream.fps:g} fps is lost")
    elif found.fps != stream.fps:
        stream.notes.append(
            f"MDD stores times as float32: {stream.fps!r} fps reads as {found.fps!r}"
        )
    if found.start_s != stream.start_s:
        stream.notes.append(
            f"MDD stores times as float32: the start at {stream.start_s!r} s reads as "
            f"{found.start_s!r} s"
        )


def _timing(times: npt.NDArray[Any]) -> FrameTimes:
    """Infer frame rate and start that round to the given float32 times, if possible.

    Starts at a whole frame number are preferred, then the shortest decimal of the first time (0.1
    rather than 0.10000000149).
    """
    timing = frame_times(times.astype(np.float64))
    decimal = float(str(np.float32(times[0])))
    rates = dict.fromkeys([timing.fps, round(timing.fps, 2), round(timing.fps, 3)])
    rates.pop(0.0, None)
    on_frame = [(fps, round(float(times[0]) * fps) / fps) for fps in rates]
    for fps, start_s in on_frame + [(fps, decimal) for fps in rates]:
        if np.array_equal(_times(fps, start_s, len(times)), times):
            return FrameTimes(fps, start_s, is_even=True)
    return FrameTimes(timing.fps, decimal, timing.is_even)


def _times(fps: float, start_s: float, n_frames: int) -> npt.NDArray[Any]:
    with np.errstate(over="ignore"):
        return (start_s + np.arange(n_frames) / fps).astype(TIME)


def _read_header(path: Path) -> tuple[int, npt.NDArray[Any]]:
    """Read the number of vertices and the frame times."""
    with os_errors_naming(path), path.open("rb") as file:
        head, size_bytes = file.read(HEADER.size), path.stat().st_size
        if len(head) < HEADER.size:
            raise FormatError(f"is not an MDD file: it has only {size_bytes} bytes")
        n_frames, n_verts = HEADER.unpack(head)
        check_cache_size(HEADER.size + TIME.itemsize * n_frames, n_frames, n_verts, size_bytes)
        times = np.frombuffer(file.read(TIME.itemsize * n_frames), TIME)
    if not np.isfinite(times).all():
        raise FormatError("is damaged: frame times are not finite")
    return n_verts, times
