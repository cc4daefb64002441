"""A whole sequence in one numpy archive: ``vertices``, ``faces`` and maybe ``fps`` and ``name``."""

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
from meshreel.formats.frame_stream import FrameStream
from meshreel.formats.naming import errors_naming
from meshreel.formats.options import WriteOptions
from meshreel.sequence import MeshSequence

NAMES = ("vertices", "faces", "fps", "name")
MAX_DEFLATE_RATIO = 1100  # deflate cannot do better than 1032 : 1


def read_npz(path: Path, *, fps: float | None = None) -> MeshSequence:
    """The sequence in an ``.npz`` file.

    Parameters
    ----------
    path : Path
        Holds arrays ``vertices`` (T, V, 3) in float32 or float64 and ``faces`` (M, 3); a number
        ``fps`` and a text ``name`` if known. Without a name, it is that of the file.
    fps : float, optional
        Frames per second to use in place of what the file says.

    Raises
    ------
    FormatError
        If the file is not a numpy archive, is damaged, or lacks an array.
    InvalidInputError
        If the arrays are no mesh sequence.
    """
    arrays = read_arrays(path, NAMES)
    vertices = arrays["vertices"]
    vertices = np.ascontiguousarray(vertices, dtype=vertices.dtype.newbyteorder("="))
    with errors_naming(path):
        rate, name = describe_npz(path, arrays, fps)
        return MeshSequence(vertices, arrays["faces"], rate, name)


def write_npz(path: Path, stream: FrameStream, options: WriteOptions) -> None:
    """Write an ``.npz`` file, frame by frame, that reads back as exactly the frames of `stream`.

    Its bytes are those of `numpy.savez`, which would need all frames together.
    """
    shape = (stream.n_frames, stream.n_verts, 3)
    descr = np.lib.format.dtype_to_descr(stream.dtype)
    header = {"descr": descr, "fortran_order": False, "shape": shape}
    rest: dict[str, npt.NDArray[Any]] = {
        "faces": stream.faces,
        "fps": np.asarray(np.float64(stream.fps)),
        "name": np.asarray(np.str_(stream.name)),
    }
    with zipfile.ZipFile(path, "w") as archive:
        with archive.open("vertices.npy", "w", force_zip64=True) as member:
            np.lib.format.write_array_header_1_0(member, header)
            for frame in stream.frames():
                member.write(frame.tobytes())
        for name, array in rest.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, array, allow_pickle=False)


def read_arrays(path: Path, wanted: Sequence[str]) -> dict[str, npt.NDArray[Any]]:
    """The arrays of an ``.npz`` file that are wanted and there.

    Raises
    ------
    FormatError
        If the file is not a numpy archive, is damaged, or lacks vertices or faces.
    """
    with archive_errors(path), zipfile.ZipFile(path) as archive:
        names = [info.filename.removesuffix(".npy") for info in archive.infolist()]
        missing = [name for name in ("vertices", "faces") if name not in names]
        if missing:
            raise FormatError(
                f"has no array {' and no array '.join(map(repr, missing))}; it holds "
                f"{', '.join(names) or 'nothing'}; "
                "save it with np.savez(..., vertices=, faces=, fps=)"
            )
        wanted = [name for name in wanted if name in names]
        for name in wanted:
            read_array_header(archive, archive.getinfo(f"{name}.npy"))
        with np.load(path, allow_pickle=False) as members:
            return {name: members[name] for name in wanted}


def describe_npz(
    path: Path, arrays: dict[str, npt.NDArray[Any]], fps: float | None
) -> tuple[float, str]:
    """Frame rate and name of the sequence in an ``.npz`` file.

    Raises
    ------
    FormatError
        If the frame rate is asked of the file, and is not one number.
    """
    name = _sequence_name(arrays["name"]) if "name" in arrays else ""
    if fps is None:
        fps = _frame_rate(arrays["fps"]) if "fps" in arrays else 0.0
    return fps, name or path.stem


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


def _sequence_name(array: npt.NDArray[Any]) -> str:
    return str(array.ravel()[0]) if array.dtype.kind == "U" and array.size == 1 else ""


def _frame_rate(array: npt.NDArray[Any]) -> float:
    if array.dtype.kind not in "iuf" or array.size != 1:
        raise FormatError(f"fps must be one number; got {array.dtype} of shape {array.shape}")
    return float(array.ravel()[0])
