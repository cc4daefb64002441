"""Safe reading of arrays in untrusted numpy archives."""

import math
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.arrays.named_arrays import RESERVED_NAMES, text_array, text_list
from meshreel.formats.arrays.named_tracks import (
    TRACKS_FOLDER,
    Candidate,
    NamedTrack,
    array_names,
    named_tracks,
)
from meshreel.formats.frames.stored_frames import Description
from meshreel.model.notes import Notes
from meshreel.model.tracks import TrackSource

MAX_DEFLATE_RATIO = 1100  # deflate compresses by at most 1032:1

READ_BYTES = 1 << 16

MIN_UNPACKED_BYTES = 1 << 30
MAX_EXPANSION = 32
"""The arrays of a file may expand to the larger of this size and this multiple of its size."""


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
            read_array_header(archive, member)
        _check_expansion(sum(member.file_size for member in members), path.stat().st_size)
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


def _check_expansion(unpacked_bytes: int, file_bytes: int) -> None:
    """Reject decompression bombs."""
    if unpacked_bytes > max(MIN_UNPACKED_BYTES, MAX_EXPANSION * file_bytes):
        raise FormatError(
            f"has {file_bytes / 1e6:.3g} MB that would unpack to {unpacked_bytes / 1e9:.3g} GB; "
            f"arrays beyond {MIN_UNPACKED_BYTES / 1e9:.3g} GB may unpack to at most "
            f"{MAX_EXPANSION} times the size of the file; if the file is valid, save it without "
            "compression: np.savez(path, **np.load(packed))"
        )


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
class ArrayHeader:
    """The npy header of an array in an archive."""

    shape: tuple[int, ...]
    is_fortran_ordered: bool
    dtype: np.dtype[Any]
    size_bytes: int
    """Size of the header itself; the data follows it."""


def read_array_header(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> ArrayHeader:
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
        header = ArrayHeader(shape, is_fortran_ordered, dtype, stream.tell())
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


Array = npt.NDArray[Any]

NO_NUMBERS = np.dtype(object)
"""Type of members that are not arrays."""


def track_arrays(tracks: Mapping[str, TrackSource]) -> dict[str, Array]:
    """Return the arrays that describe tracks, by name; empty if there are no tracks."""
    if not tracks:
        return {}
    return {
        "track_names": text_array(list(tracks)),
        "track_kinds": text_array([track.kind for track in tracks.values()]),
        "track_domains": text_array([track.domain for track in tracks.values()]),
        "track_units": text_array([track.unit for track in tracks.values()]),
    }


def find_tracks(
    path: Path,
    arrays: Mapping[str, Array],
    positions: str,
    sizes: tuple[int, int],
    description: Description,
    notes: Notes,
) -> dict[str, NamedTrack]:
    """Find the tracks of an archive, without reading their values.

    Parameters
    ----------
    arrays : mapping of str to array
        The named arrays of the archive.
    positions : str
        Name of the array of positions.
    sizes : tuple of int
        Number of frames and vertices.
    notes : Notes
        Receives a sentence on arrays that are not tracks.

    Raises
    ------
    FormatError
        If a described track is missing, or the descriptions differ in number.
    InvalidInputError
        If two tracks share a name.
    """
    descriptions = _track_descriptions(arrays)
    with archive_errors(path), zipfile.ZipFile(path) as archive:
        candidates = [
            _candidate(archive, info, descriptions)
            for info in archive.infolist()
            for name in [info.filename.removesuffix(".npy")]
            if name != positions and not RESERVED_NAMES.fullmatch(name)
        ]
        if missing := descriptions.keys() - {candidate.path for candidate in candidates}:
            raise FormatError(f"has no array {min(missing)!r}, which other arrays refer to")
    return named_tracks(candidates, *sizes, description, notes)


def _candidate(
    archive: zipfile.ZipFile, info: zipfile.ZipInfo, descriptions: Mapping[str, tuple[str, ...]]
) -> Candidate:
    array_path = info.filename.removesuffix(".npy")
    default_name = array_path.removeprefix(f"{TRACKS_FOLDER}/")
    name, *description = descriptions.get(array_path, (default_name,))
    try:
        header = read_array_header(archive, info)
    # Damaged or other members are not part of the sequence; the notes list them.
    except Exception:
        return Candidate(array_path, name, (), NO_NUMBERS)
    if array_path == info.filename:  # numpy does not load members without the extension .npy
        return Candidate(array_path, name, (), NO_NUMBERS)
    return Candidate(array_path, name, header.shape, header.dtype, *description)


def _track_descriptions(arrays: Mapping[str, Array]) -> dict[str, tuple[str, ...]]:
    """Name, domain, kind and unit of each track, by the name of its array."""
    columns = [
        text_list(arrays, f"track_{field}") for field in ("names", "domains", "kinds", "units")
    ]
    if len({len(column) for column in columns}) > 1:
        counts = ", ".join(str(len(column)) for column in columns)
        raise FormatError(
            f"has {counts} track_names, track_domains, track_kinds and track_units; the numbers "
            "must be equal"
        )
    names = array_names(columns[0])
    if len(names) < len(columns[0]):
        raise FormatError(f"has duplicate track names in {', '.join(columns[0])}")
    rows = zip(*columns, strict=True)
    return {f"{TRACKS_FOLDER}/{names[row[0]]}": row for row in rows}
