"""NumPy archives (``.npz``) with one sequence; uncompressed arrays are read on demand.

The names of the arrays are those of `meshreel.formats.arrays.named_arrays`. Archives are not
trusted: the header of an array is checked against its member before anything is allocated.
"""

import math
import struct
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
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
    text_array,
    text_list,
    vertex_numbers,
)
from meshreel.formats.arrays.named_tracks import (
    TRACKS_FOLDER,
    Candidate,
    NamedTrack,
    array_names,
    named_tracks,
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

MAX_DEFLATE_RATIO = 1100  # deflate compresses by at most 1032:1

READ_BYTES = 1 << 16

MIN_UNPACKED_BYTES = 1 << 30
MAX_EXPANSION = 32
"""The arrays of a file may expand to the larger of this size and this multiple of its size."""


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
    raw_vertices = None if max_bytes is None else _find_raw_array(path, positions)
    if raw_vertices is not None:
        shape, dtype = raw_vertices.shape, raw_vertices.dtype
        # Shapes that may also be (V, 3, T) are loaded.
        is_plain = has_positions(shape) and shape[2] == 3 != shape[1]
        if dtype.kind != "f" or dtype.itemsize not in (4, 8) or not is_plain:
            raw_vertices = None
    arrays = _read_arrays(path, positions, with_positions=raw_vertices is None)
    if raw_vertices is None:
        vertices = arrays[positions]
        with errors_naming(path):
            layout = find_layout(
                vertices.shape,
                vertex_numbers(arrays),
                positions,
                is_documented=positions == POSITIONS,
            )
        if layout is Layout.FRAMES_LAST:
            vertices = vertices.transpose(2, 0, 1)
        arrays[positions] = np.ascontiguousarray(vertices)
    n_frames, n_verts = (
        raw_vertices.shape if raw_vertices is not None else arrays[positions].shape
    )[:2]
    with errors_naming(path):
        description = read_description(arrays, path.stem, reading, n_frames, n_verts)
    candidates = _find_candidates(path, arrays, positions)
    found = named_tracks(candidates, n_frames, n_verts, description, reading.notes)
    if raw_vertices is not None and max_bytes is not None:
        sizes = [(raw_vertices.shape, raw_vertices.dtype)]
        sizes += [(track.shape, track.dtype) for track in found.values()]
        if sum(math.prod(shape) * dtype.itemsize for shape, dtype in sizes) > max_bytes:
            tracks: dict[str, TrackSource] = {}
            for name, track in found.items():
                raw_values = _find_raw_array(path, track.path)
                if raw_values is None:  # compressed, or not in C order
                    tracks[name] = _load(track, read_members(path, [track.path])[track.path])
                else:
                    verify_member(path, track.path)
                    tracks[name] = track.stored_track(CheckedReader(path, raw_values.read))
            verify_member(path, positions)
            return description.open_array(raw_vertices, tracks, max_bytes, reading.progress)
        arrays |= read_members(path, [positions])
    values = read_members(path, [track.path for track in found.values()])
    loaded_tracks = {name: _load(track, values[track.path]) for name, track in found.items()}
    with errors_naming(path):
        sequence = description.sequence(native(arrays[positions]), loaded_tracks)
    reading.progress("reading", 1.0)
    return sequence


def _load(track: NamedTrack, values: Numbers) -> Track:
    stored_track = track.stored_track(lambda start, stop: values[start:stop])
    return track_like(stored_track, hand_over(stored_track.read(0, len(values))))


def _read_arrays(
    path: Path, positions: str, *, with_positions: bool
) -> dict[str, npt.NDArray[Any]]:
    """Read the named arrays of an archive, except tracks; it must have positions and faces."""
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


def _find_candidates(path: Path, arrays: Mapping[str, Numbers], positions: str) -> list[Candidate]:
    """Return the arrays that may be tracks, without reading their values."""
    columns = [
        text_list(arrays, f"track_{field}") for field in ("names", "domains", "kinds", "units")
    ]
    if len({len(column) for column in columns}) > 1:
        counts = ", ".join(str(len(column)) for column in columns)
        raise FormatError(
            f"has {counts} track_names, track_domains, track_kinds and track_units; the numbers "
            "must be equal"
        )
    stored_names = array_names(columns[0])
    if len(stored_names) < len(columns[0]):
        raise FormatError(f"has duplicate track names in {', '.join(columns[0])}")
    rows = {f"{TRACKS_FOLDER}/{stored_names[row[0]]}": row for row in zip(*columns, strict=True)}

    candidates = []
    with archive_errors(path), zipfile.ZipFile(path) as archive:
        for info in archive.infolist():
            array_path = info.filename.removesuffix(".npy")
            if array_path == positions or RESERVED_NAMES.fullmatch(array_path):
                continue
            default_name = array_path.removeprefix(f"{TRACKS_FOLDER}/")
            name, *description = rows.get(array_path, (default_name,))
            candidate = Candidate(array_path, name, (), np.dtype(object))  # no numbers, no track
            # Damaged or other members are not part of the sequence; the notes list them. So do they
            # with members without the extension .npy, which numpy does not load.
            with suppress(Exception):
                header = _read_header(archive, info)
                if array_path != info.filename:
                    candidate = Candidate(
                        array_path, name, header.shape, header.dtype, *description
                    )
            candidates.append(candidate)
        if missing := rows.keys() - {candidate.path for candidate in candidates}:
            raise FormatError(f"has no array {min(missing)!r}, which other arrays refer to")
    return candidates


def _find_raw_array(path: Path, name: str) -> RawArray | None:
    """Locate an uncompressed array in C order; None if it is missing or stored otherwise."""
    member = f"{name}.npy"
    with archive_errors(path):
        with zipfile.ZipFile(path) as archive:
            if member not in archive.namelist():
                return None
            info = archive.getinfo(member)
            header = _read_header(archive, info)
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


def read_members(path: Path, names: Sequence[str]) -> dict[str, npt.NDArray[Any]]:
    """Read arrays of an archive by name.

    Raises
    ------
    FormatError
        If an array is damaged, or the arrays would expand too much (see `MAX_EXPANSION`).
    """
    with archive_errors(path), zipfile.ZipFile(path) as archive:
        members = [archive.getinfo(f"{name}.npy") for name in names]
        for member in members:
            _read_header(archive, member)
        unpacked_bytes, file_bytes = sum(it.file_size for it in members), path.stat().st_size
        if unpacked_bytes > max(MIN_UNPACKED_BYTES, MAX_EXPANSION * file_bytes):
            raise FormatError(
                f"has {file_bytes / 1e6:.3g} MB that would unpack to {unpacked_bytes / 1e9:.3g} "
                f"GB; arrays beyond {MIN_UNPACKED_BYTES / 1e9:.3g} GB may unpack to at most "
                f"{MAX_EXPANSION} times the size of the file; if the file is valid, save it "
                "without compression: np.savez(path, **np.load(packed))"
            )
        with np.load(path, allow_pickle=False) as arrays:
            return {name: arrays[name] for name in names}


def verify_member(path: Path, name: str) -> None:
    """Read an array, a block at a time, to verify the checksum of the archive.

    Raises
    ------
    FormatError
        If the checksum is wrong.
    """
    member = f"{name}.npy"
    with archive_errors(path), zipfile.ZipFile(path) as archive, archive.open(member) as stream:
        try:
            while stream.read(READ_BYTES):
                pass
        except zipfile.BadZipFile:
            raise FormatError(
                f"is damaged: {member} does not match its checksum; save it again"
            ) from None


@contextmanager
def archive_errors(path: Path) -> Iterator[None]:
    """Context manager that turns errors of reading an archive into a `FormatError` naming it."""
    try:
        yield
    except FormatError as error:
        raise FormatError(*error.args, path=path) from None
    except MemoryError:  # not damage: a batch retries with fewer workers
        raise
    # On damaged files zipfile, zlib and numpy raise many types of exceptions.
    except Exception as error:
        raise FormatError(
            f"is not a numpy archive, or is damaged ({error}); save it again with np.savez",
            path=path,
        ) from error


@dataclass(frozen=True)
class _Header:
    """The npy header of an array in an archive."""

    shape: tuple[int, ...]
    is_fortran_ordered: bool
    dtype: np.dtype[Any]
    size_bytes: int
    """Size of the header itself; the data follows it."""


def _read_header(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> _Header:
    """Read the header of an array, checked against the size of its member.

    Raises
    ------
    FormatError
        If they do not agree; nothing has been allocated yet.
    """
    with archive.open(info) as stream:
        version = np.lib.format.read_magic(stream)
        if version == (1, 0):
            shape, is_fortran_ordered, dtype = np.lib.format.read_array_header_1_0(stream)
        elif version == (2, 0):
            shape, is_fortran_ordered, dtype = np.lib.format.read_array_header_2_0(stream)
        else:
            raise FormatError(
                f"{info.filename} has npy version {version}; 1.0 and 2.0 are supported"
            )
        header = _Header(shape, is_fortran_ordered, dtype, stream.tell())
    if dtype.hasobject:
        raise FormatError(f"{info.filename} contains Python objects; save it as numbers")
    if math.prod(shape) * dtype.itemsize + header.size_bytes != info.file_size:
        raise FormatError(
            f"{info.filename} declares shape {shape} of {dtype}, which is not its size of "
            f"{info.file_size - header.size_bytes} bytes; the file is damaged"
        )
    if info.file_size > MAX_DEFLATE_RATIO * info.compress_size:
        raise FormatError(f"{info.filename} declares more than its compressed data can contain")
    return header


def write_npz(path: Path, segments: SegmentedStream, options: WriteOptions) -> None:
    """Write an ``.npz`` file frame by frame; positions and tracks round-trip exactly.

    The bytes are those of `numpy.savez`, which would need all frames in memory. Defaults are
    omitted: a start of 0, a plain surface.
    """
    stream = segments.only()
    arrays = described_arrays(stream)
    if tracks := stream.tracks.values():
        arrays["track_names"] = text_array(list(stream.tracks))
        arrays["track_kinds"] = text_array([track.kind for track in tracks])
        arrays["track_domains"] = text_array([track.domain for track in tracks])
        arrays["track_units"] = text_array([track.unit for track in tracks])
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
