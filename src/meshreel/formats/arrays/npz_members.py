"""Arrays in a numpy archive, read with every size checked."""

import math
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError

MAX_DEFLATE_RATIO = 1100  # deflate cannot do better than 1032 : 1

LEAST_UNPACKED_BYTES = 1 << 30
EXPANSION = 32
"""The arrays of a file may take so many bytes, or so many times its size, as in glTF."""


def read_members(path: Path, names: Sequence[str]) -> dict[str, npt.NDArray[Any]]:
    """Arrays of an archive by their names.

    Raises
    ------
    FormatError
        If one is damaged, or they are compressed so well that they would fill the memory (see
        `EXPANSION`).
    """
    with archive_errors(path), zipfile.ZipFile(path) as archive:
        members = [archive.getinfo(f"{name}.npy") for name in names]
        for member in members:
            read_array_header(archive, member)
        _check_expansion(sum(member.file_size for member in members), path.stat().st_size)
        with np.load(path, allow_pickle=False) as arrays:
            return {name: arrays[name] for name in names}


def _check_expansion(unpacked_bytes: int, file_bytes: int) -> None:
    """Refuse a small file that would fill the memory."""
    if unpacked_bytes > max(LEAST_UNPACKED_BYTES, EXPANSION * file_bytes):
        raise FormatError(
            f"holds {file_bytes / 1e6:.3g} MB that would unpack to {unpacked_bytes / 1e9:.3g} GB; "
            f"more than {EXPANSION} times the size of the file is unpacked up to "
            f"{LEAST_UNPACKED_BYTES / 1e9:.3g} GB only; if it is so, save it without compression: "
            "np.savez(path, **np.load(packed))"
        )


@contextmanager
def archive_errors(path: Path) -> Iterator[None]:
    """Within it, whatever goes wrong with an archive is a `FormatError` that names it."""
    try:
        yield
    except FormatError as error:
        raise FormatError(f"{path}: {error}") from None
    except MemoryError:  # of a file whose headers fit it; a batch tries it with less
        raise
    # On damaged bytes zipfile, zlib and numpy raise nearly every type of exception there is.
    except Exception as error:
        raise FormatError(
            f"{path}: is not a numpy archive, or is damaged ({error}); save it again with np.savez"
        ) from error


@dataclass(frozen=True)
class ArrayHeader:
    """How an array lies in its member of an archive.

    Attributes
    ----------
    size_bytes : int
        Of the header, after which the data begin.
    """

    shape: tuple[int, ...]
    is_fortran_ordered: bool
    dtype: np.dtype[Any]
    size_bytes: int


def read_array_header(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> ArrayHeader:
    """The header of an array, whose size is known to agree with the declared shape.

    Raises
    ------
    FormatError
        If it does not, so before anything is allocated.
    """
    with archive.open(info) as stream:
        version = np.lib.format.read_magic(stream)
        if version == (1, 0):
            shape, is_fortran_ordered, dtype = np.lib.format.read_array_header_1_0(stream)
        elif version == (2, 0):
            shape, is_fortran_ordered, dtype = np.lib.format.read_array_header_2_0(stream)
        else:
            raise FormatError(f"{info.filename} has npy version {version}; 1.0 and 2.0 are read")
        header = ArrayHeader(shape, is_fortran_ordered, dtype, stream.tell())
    if dtype.hasobject:
        raise FormatError(f"{info.filename} holds Python objects; save it as numbers")
    if math.prod(shape) * dtype.itemsize + header.size_bytes != info.file_size:
        raise FormatError(
            f"{info.filename} declares shape {shape} of {dtype}, which is not its size of "
            f"{info.file_size - header.size_bytes} bytes; the file is damaged"
        )
    if info.file_size > MAX_DEFLATE_RATIO * info.compress_size:
        raise FormatError(f"{info.filename} declares more than its packed bytes can hold")
    return header
