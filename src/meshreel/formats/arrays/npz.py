"""NumPy archives (``.npz``) with one sequence; uncompressed arrays are read on demand.

The names of the arrays are those of `meshreel.formats.arrays.named_arrays`.
"""

import math
import struct
import zipfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import native
from meshreel.errors import FormatError, Keyword
from meshreel.formats.arrays.named_arrays import (
    RESERVED_NAMES,
    Layout,
    described_arrays,
    find_layout,
    has_positions,
    read_description,
    vertex_numbers,
)
from meshreel.formats.arrays.named_tracks import TRACKS_FOLDER, NamedTrack, array_names
from meshreel.formats.arrays.npz_members import (
    archive_errors,
    find_tracks,
    read_array_header,
    read_members,
    track_arrays,
    verify_member,
)
from meshreel.formats.file_errors import errors_naming
from meshreel.formats.frames.frame_stream import SegmentedStream
from meshreel.formats.frames.stored_frames import CheckedReader, RawArray
from meshreel.formats.kinds import EVERY_DOMAIN, SequenceFormat
from meshreel.formats.options import Reading, WriteOptions
from meshreel.model.sequence import FrameSource
from meshreel.model.tracks import Track, TrackSource, track_blocks, track_like
from meshreel.model.validation import hand_over

Numbers = npt.NDArray[Any]

LOCAL_HEADER = struct.Struct("<26xHH")  # of a zip member: lengths of its name and extra field

POSITIONS = "vertices"


def open_npz(path: Path, reading: Reading) -> FrameSource:
    """Open the sequence of an ``.npz`` file; large positions and tracks may stay in the file.

    They must be uncompressed and in C order. They are then read now, in blocks, to verify the
    archive's checksum and to find the extent. Other arrays are loaded.

    Parameters
    ----------
    path : Path
        Contains the arrays of `meshreel.formats.arrays.named_arrays`. The default name of the
        sequence is the stem of the file.
    reading : Reading
        `dataset` names the array of positions.

    Raises
    ------
    FormatError
        If the file is not a numpy archive, is damaged, or lacks an array.
    InvalidInputError
        If the arrays are not a valid mesh sequence; also when frames are read, if the file has
        changed.
    """
    positions, max_bytes = reading.dataset or POSITIONS, reading.max_loaded_bytes
    raw_vertices = None if max_bytes is None else _find_vertices(path, positions)
    arrays = read_arrays(path, positions, with_positions=raw_vertices is None)
    if raw_vertices is None:
        arrays[positions] = _frames_first(path, arrays, positions)
    n_frames, n_verts = (
        raw_vertices.shape if raw_vertices is not None else arrays[positions].shape
    )[:2]
    counts = n_frames, n_verts
    with errors_naming(path):
        description = read_description(arrays, path.stem, reading, n_frames, n_verts)
    named_tracks = find_tracks(path, arrays, positions, counts, description, reading.notes)
    if raw_vertices is not None and max_bytes is not None:
        sizes = [(raw_vertices.shape, raw_vertices.dtype)]
        sizes += [(track.shape, track.dtype) for track in named_tracks.values()]
        if sum(math.prod(shape) * dtype.itemsize for shape, dtype in sizes) > max_bytes:
            tracks = {name: _open_track(path, track) for name, track in named_tracks.items()}
            verify_member(path, positions)
            return description.open_array(raw_vertices, tracks, max_bytes, reading.progress)
        arrays |= read_members(path, [positions])
    values = read_members(path, [track.path for track in named_tracks.values()])
    loaded_tracks = {name: _load(track, values[track.path]) for name, track in named_tracks.items()}
    with errors_naming(path):
        sequence = description.sequence(native(arrays[positions]), loaded_tracks)
    reading.progress("reading", 1.0)
    return sequence


def _frames_first(path: Path, arrays: Mapping[str, Numbers], positions: str) -> Numbers:
    """Return the loaded positions in the shape (T, V, 3)."""
    vertices = arrays[positions]
    with errors_naming(path):
        layout = find_layout(
            vertices.shape, vertex_numbers(arrays), positions, is_documented=positions == POSITIONS
        )
    if layout is Layout.FRAMES_LAST:
        vertices = vertices.transpose(2, 0, 1)
    return np.ascontiguousarray(vertices)


def _open_track(path: Path, track: NamedTrack) -> TrackSource:
    """Return a track that stays in the file, after verifying it; a loaded one if compressed."""
    raw_values = _find_raw_array(path, track.path)
    if raw_values is None:
        return _load(track, read_members(path, [track.path])[track.path])
    verify_member(path, track.path)
    return track.stored_track(CheckedReader(path, raw_values.read))


def _load(track: NamedTrack, values: Numbers) -> Track:
    stored_track = track.stored_track(lambda start, stop: values[start:stop])
    return track_like(stored_track, hand_over(stored_track.read(0, len(values))))


def _find_vertices(path: Path, positions: str) -> RawArray | None:
    """Locate positions that can stay in the file; None if they must be loaded."""
    array = _find_raw_array(path, positions)
    if array is None or array.dtype.kind != "f" or array.dtype.itemsize not in (4, 8):
        return None
    # Shapes that may also be (V, 3, T) are loaded.
    return array if has_positions(array.shape) and array.shape[2] == 3 != array.shape[1] else None


def _find_raw_array(path: Path, name: str) -> RawArray | None:
    """Locate an uncompressed array in C order; None if it is missing or stored otherwise."""
    member = f"{name}.npy"
    with archive_errors(path):
        with zipfile.ZipFile(path) as archive:
            if member not in archive.namelist():
                return None
            info = archive.getinfo(member)
            header = read_array_header(archive, info)
        is_plain = info.compress_type == zipfile.ZIP_STORED and not header.is_fortran_ordered
        if not is_plain or 0 in header.shape or not header.shape:
            return None
        with path.open("rb") as stream:
            stream.seek(info.header_offset)
            lengths = LOCAL_HEADER.unpack(stream.read(LOCAL_HEADER.size))
            start_byte = stream.seek(sum(lengths), 1)
        if start_byte + info.file_size > path.stat().st_size:
            raise FormatError(f"{member} extends beyond the end of the file")
    return RawArray(path, start_byte + header.size_bytes, header.shape, header.dtype)


def write_npz(path: Path, segments: SegmentedStream, options: WriteOptions) -> None:
    """Write an ``.npz`` file frame by frame; positions and tracks round-trip exactly.

    The bytes are those of `numpy.savez`, which would need all frames in memory. Defaults are
    omitted: a start of 0, a plain surface.
    """
    stream = segments.only()
    arrays = described_arrays(stream) | track_arrays(stream.tracks)
    stored_names = array_names(stream.tracks)
    shape = (stream.n_frames, stream.n_verts, 3)
    with zipfile.ZipFile(path, "w") as archive:
        _write_member(archive, "vertices", stream.dtype, shape, stream.frames())
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, array, allow_pickle=False)
        for name, track in stream.tracks.items():
            blocks = (values for _, values in track_blocks(track))
            array_path = f"{TRACKS_FOLDER}/{stored_names[name]}"
            _write_member(archive, array_path, track.dtype, track.shape, blocks)


def _write_member(
    archive: zipfile.ZipFile,
    name: str,
    dtype: np.dtype[Any],
    shape: tuple[int, ...],
    blocks: Iterable[npt.NDArray[Any]],
) -> None:
    """Write an array given as consecutive blocks of rows."""
    descr = np.lib.format.dtype_to_descr(dtype)
    header = {"descr": descr, "fortran_order": False, "shape": shape}
    with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
        np.lib.format.write_array_header_1_0(member, header)
        for block in blocks:
            member.write(block.tobytes())


def read_arrays(
    path: Path, positions: str, *, with_positions: bool = True
) -> dict[str, npt.NDArray[Any]]:
    """Read the named arrays of an ``.npz`` file, except tracks.

    Parameters
    ----------
    positions : str
        Name of the array of positions, which must exist.
    with_positions : bool, default True
        Whether the positions are read too.

    Raises
    ------
    FormatError
        If the file is not a numpy archive or lacks positions or faces; also as `read_members`.
    """
    with archive_errors(path), zipfile.ZipFile(path) as archive:
        names = [info.filename.removesuffix(".npy") for info in archive.infolist()]
        missing = [name for name in (positions,) if name not in names]
        missing += [] if {"faces", "cells"} & set(names) else ["faces"]
        if missing:
            raise FormatError(
                f"has no array {' and no array '.join(map(repr, missing))}; it contains "
                f"{', '.join(names) or 'nothing'}; save vertices, faces and fps with np.savez, or "
                "name the array of positions with ",
                Keyword("dataset"),
            )
    members = [name for name in dict.fromkeys(names) if RESERVED_NAMES.fullmatch(name)]
    if with_positions and positions not in members:
        members.append(positions)
    return read_members(path, members)


FORMATS = (
    SequenceFormat(
        ".npz",
        "NumPy archive",
        open_npz,
        write_npz,
        read_options=frozenset({"dataset"}),
        track_domains=EVERY_DOMAIN,
    ),
)
