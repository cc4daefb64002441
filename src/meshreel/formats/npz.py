"""A whole sequence in one numpy archive: ``vertices``, ``faces`` and maybe ``fps`` and ``name``."""

import math
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError, MeshReelError
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
    arrays, names = _read_arrays(path)
    missing = [name for name in ("vertices", "faces") if name not in arrays]
    if missing:
        raise FormatError(
            f"{path}: has no array {' and no array '.join(map(repr, missing))}; it holds "
            f"{', '.join(names) or 'nothing'}; save it with np.savez(..., vertices=, faces=, fps=)"
        )
    vertices = arrays["vertices"]
    vertices = np.ascontiguousarray(vertices, dtype=vertices.dtype.newbyteorder("="))
    try:
        name = _sequence_name(arrays["name"]) if "name" in arrays else ""
        if fps is None:
            fps = _frame_rate(arrays["fps"]) if "fps" in arrays else 0.0
        return MeshSequence(vertices, arrays["faces"], fps, name or path.stem)
    except MeshReelError as error:
        raise type(error)(f"{path}: {error}") from None


def write_npz(path: Path, sequence: MeshSequence) -> None:
    """Write an ``.npz`` file that reads back as exactly `sequence`."""
    with path.open("wb") as stream:  # np.savez would add an ending to a path of its choice
        np.savez(
            stream,
            vertices=sequence.vertices,
            faces=sequence.faces,
            fps=np.float64(sequence.fps),
            name=np.str_(sequence.name),
        )


def _read_arrays(path: Path) -> tuple[dict[str, npt.NDArray[Any]], list[str]]:
    """The arrays that matter, and the names of all arrays of the archive."""
    try:
        with zipfile.ZipFile(path) as archive:
            names = [info.filename.removesuffix(".npy") for info in archive.infolist()]
            wanted = [name for name in NAMES if name in names]
            for name in wanted:
                _check_member(archive, archive.getinfo(f"{name}.npy"))
        with np.load(path, allow_pickle=False) as members:
            return {name: members[name] for name in wanted}, names
    except FormatError as error:
        raise FormatError(f"{path}: {error}") from None
    # On damaged bytes zipfile, zlib and numpy raise nearly every type of exception there is.
    except Exception as error:
        raise FormatError(
            f"{path}: is not a numpy archive, or is damaged ({error}); save it again with np.savez"
        ) from error


def _check_member(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> None:
    """Refuse an array whose declared shape does not agree with its size, before allocating it."""
    with archive.open(info) as stream:
        version = np.lib.format.read_magic(stream)
        if version == (1, 0):
            shape, _, dtype = np.lib.format.read_array_header_1_0(stream)
        elif version == (2, 0):
            shape, _, dtype = np.lib.format.read_array_header_2_0(stream)
        else:
            raise FormatError(f"{info.filename} has npy version {version}; 1.0 and 2.0 are read")
        header_bytes = stream.tell()
    if dtype.hasobject:
        raise FormatError(f"{info.filename} holds Python objects; save it as numbers")
    if math.prod(shape) * dtype.itemsize + header_bytes != info.file_size:
        raise FormatError(
            f"{info.filename} declares shape {shape} of {dtype}, which is not its size of "
            f"{info.file_size - header_bytes} bytes; the file is damaged"
        )
    if info.file_size > MAX_DEFLATE_RATIO * info.compress_size:
        raise FormatError(f"{info.filename} declares more than its packed bytes can hold")


def _sequence_name(array: npt.NDArray[Any]) -> str:
    return str(array.ravel()[0]) if array.dtype.kind == "U" and array.size == 1 else ""


def _frame_rate(array: npt.NDArray[Any]) -> float:
    if array.dtype.kind not in "iuf" or array.size != 1:
        raise FormatError(f"fps must be one number; got {array.dtype} of shape {array.shape}")
    return float(array.ravel()[0])
