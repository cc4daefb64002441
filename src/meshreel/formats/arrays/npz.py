"""A whole sequence in one numpy archive, with the names of `formats.arrays.named_arrays`."""

import zipfile
from collections.abc import Iterable
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
from meshreel.formats.arrays.named_tracks import FOLDER, array_names
from meshreel.formats.arrays.npz_members import archive_errors, read_members
from meshreel.formats.arrays.npz_tracks import find_tracks, track_arrays
from meshreel.formats.arrays.position_layout import Layout, find_layout
from meshreel.formats.file_errors import errors_naming
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.options import ReadOptions, WriteOptions
from meshreel.model.sequence import MeshSequence
from meshreel.model.tracks import track_blocks

POSITIONS = "vertices"


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
    arrays = read_arrays(path, positions)
    vertices = arrays[positions]
    with errors_naming(path):
        layout = find_layout(
            vertices.shape, arrays["faces"], positions, is_documented=positions == POSITIONS
        )
        if layout is Layout.FRAMES_LAST:
            vertices = vertices.transpose(2, 0, 1)
        vertices = np.ascontiguousarray(vertices, dtype=vertices.dtype.newbyteorder("="))
        about = read_description(arrays, path.stem, options)
        sizes = vertices.shape[0], vertices.shape[1]
    found = find_tracks(path, arrays, positions, sizes, about, options.notes)
    values = read_members(path, [one.place for one in found.values()])
    with errors_naming(path):
        return MeshSequence(
            vertices,
            about.faces,
            about.fps,
            about.name,
            about.start_s,
            about.surface,
            {name: one.loaded(values[one.place]) for name, one in found.items()},
        )


def write_npz(path: Path, stream: FrameStream, options: WriteOptions) -> None:
    """Write an ``.npz`` file, frame by frame, that reads back as exactly the frames of `stream`.

    Its bytes are those of `numpy.savez`, which would need all frames together. What is as in every
    plain sequence is left out: a start of 0, a surface without anything.
    """
    rest: dict[str, npt.NDArray[Any]] = {
        "faces": stream.faces,
        "fps": np.asarray(np.float64(stream.fps)),
        "name": np.asarray(np.str_(stream.name)),
        **start_arrays(stream.start_s),
        **surface_arrays(stream.surface),
        **track_arrays(stream.tracks),
    }
    places = array_names(stream.tracks)
    shape = (stream.n_frames, stream.n_verts, 3)
    with zipfile.ZipFile(path, "w") as archive:
        _write_member(archive, "vertices", stream.dtype, shape, stream.frames())
        for name, array in rest.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, array, allow_pickle=False)
        for name, track in stream.tracks.items():
            blocks = (values for _, values in track_blocks(track))
            place = f"{FOLDER}/{places[name]}"
            _write_member(archive, place, track.dtype, track.shape, blocks)


def _write_member(
    archive: zipfile.ZipFile,
    name: str,
    dtype: np.dtype[Any],
    shape: tuple[int, ...],
    blocks: Iterable[npt.NDArray[Any]],
) -> None:
    """Write an array that comes in pieces, which are its rows in order."""
    descr = np.lib.format.dtype_to_descr(dtype)
    header = {"descr": descr, "fortran_order": False, "shape": shape}
    with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
        np.lib.format.write_array_header_1_0(member, header)
        for block in blocks:
            member.write(block.tobytes())


def read_arrays(
    path: Path, positions: str, *, with_positions: bool = True
) -> dict[str, npt.NDArray[Any]]:
    """The arrays of an ``.npz`` file that make a sequence, but for tracks.

    Parameters
    ----------
    path : Path
    positions : str
        The array that holds the positions, which must be there.
    with_positions : bool, default True
        Whether that is read too.

    Raises
    ------
    FormatError
        If the file is not a numpy archive, lacks positions or faces, or as `read_members`.
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
    if with_positions and positions not in wanted:
        wanted.append(positions)
    return read_members(path, wanted)
