"""A whole sequence in one numpy archive, with the names of `formats.arrays.named_arrays`."""

import math
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.arrays.named_arrays import (
    NAMED,
    read_description,
    start_arrays,
    surface_arrays,
)
from meshreel.formats.arrays.position_layout import Layout, find_layout
from meshreel.formats.file_errors import errors_naming
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.notes import note_kinds
from meshreel.formats.options import ReadOptions, WriteOptions
from meshreel.sequence import MeshSequence

POSITIONS = "vertices"
MAX_DEFLATE_RATIO = 1100  # deflate cannot do better than 1032 : 1

LEAST_UNPACKED_BYTES = 1 << 30
EXPANSION = 32
"""The arrays of a file may take so many bytes, or so many times its size, as in glTF."""


def read_npz(path: Path, options: ReadOptions | None = None) -> MeshSequence:
    """The sequence in an ``.npz`` file, all in memory.

    Parameters
    ----------
    path : Path
        Holds the arrays of `formats.arrays.named_arrays`. Without a name, it is that of the
        file.
    options : ReadOptions, optional
        Its dataset is the array that holds the positions.

    Raises
    ------
    FormatError
        If the file is not a numpy archive, is damaged, or lacks an array.
    InvalidInputError
        If the arrays are no mesh sequence.
    """
    options = options or ReadOptions()
    positions = options.dataset or POSITIONS
    arrays = read_arrays(path, positions, options.notes)
    vertices = arrays[positions]
    with errors_naming(path):
        layout = find_layout(
            vertices.shape, arrays["faces"], positions, is_documented=positions == POSITIONS
        )
        if layout is Layout.FRAMES_LAST:
            vertices = vertices.transpose(2, 0, 1)
        vertices = np.ascontiguousarray(vertices, dtype=vertices.dtype.newbyteorder("="))
        about = read_description(arrays, path.stem, options)
        return MeshSequence(
            vertices, about.faces, about.fps, about.name, about.start_s, about.surface
        )


def write_npz(path: Path, stream: FrameStream, options: WriteOptions) -> None:
    """Write an ``.npz`` file, frame by frame, that reads back as exactly the frames of `stream`.

    Its bytes are those of `numpy.savez`, which would need all frames together. What is as in every
    plain sequence is left out: a start of 0, a surface without anything.
    """
    shape = (stream.n_frames, stream.n_verts, 3)
    descr = np.lib.format.dtype_to_descr(stream.dtype)
    header = {"descr": descr, "fortran_order": False, "shape": shape}
    rest: dict[str, npt.NDArray[Any]] = {
        "faces": stream.faces,
        "fps": np.asarray(np.float64(stream.fps)),
        "name": np.asarray(np.str_(stream.name)),
        **start_arrays(stream.start_s),
        **surface_arrays(stream.surface),
    }
    with zipfile.ZipFile(path, "w") as archive:
        with archive.open("vertices.npy", "w", force_zip64=True) as member:
            np.lib.format.write_array_header_1_0(member, header)
            for frame in stream.frames():
                member.write(frame.tobytes())
        for name, array in rest.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, array, allow_pickle=False)


def read_arrays(
    path: Path, positions: str, notes: list[str], *, with_positions: bool = True
) -> dict[str, npt.NDArray[Any]]:
    """The arrays of an ``.npz`` file that make a sequence.

    Parameters
    ----------
    path : Path
    positions : str
        The array that holds the positions, which must be there.
    notes : list of str
        Gains a sentence on arrays that are not of the sequence.
    with_positions : bool, default True
        Whether that is read too.

    Raises
    ------
    FormatError
        If the file is not a numpy archive, is damaged, lacks positions or faces, or is compressed
        so well that it would fill the memory (see `EXPANSION`).
    """
    with archive_errors(path), zipfile.ZipFile(path) as archive:
        names = [info.filename.removesuffix(".npy") for info in archive.infolist()]
        missing = [name for name in (positions, "faces") if name not in names]
        if missing:
            raise FormatError(
                f"has no array {' and no array '.join(map(repr, missing))}; it holds "
                f"{', '.join(names) or 'nothing'}; save it by np.savez under the names vertices, "
                "faces and fps, or say which holds the positions with --dataset (dataset=)"
            )
        wanted = [name for name in dict.fromkeys(names) if NAMED.fullmatch(name)]
        note_kinds(notes, "arrays", (one for one in names if one not in {*wanted, positions}))
        if with_positions and positions not in wanted:
            wanted.append(positions)
        members = [archive.getinfo(f"{name}.npy") for name in wanted]
        for member in members:
            read_array_header(archive, member)
        _check_expansion(sum(member.file_size for member in members), path.stat().st_size)
        with np.load(path, allow_pickle=False) as arrays:
            return {name: arrays[name] for name in wanted}


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
    shape : tuple of int
    is_fortran_ordered : bool
    dtype : dtype
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
