"""The frames of an ``.npz`` file that is not compressed, read when they are asked for."""

import struct
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.arrays.named_arrays import read_description
from meshreel.formats.arrays.npz import (
    POSITIONS,
    archive_errors,
    read_array_header,
    read_arrays,
    read_npz,
)
from meshreel.formats.arrays.position_layout import has_positions
from meshreel.formats.file_errors import errors_naming, os_errors_naming
from meshreel.formats.frames.stored_frames import StoredFrames, changed_error
from meshreel.formats.frames.survey import FrameSurvey
from meshreel.formats.options import ReadOptions
from meshreel.runtime.progress import Count
from meshreel.sequence import FrameSource, Vertices, validate_finite

LOCAL_HEADER = struct.Struct("<26xHH")  # of a member of a zip file; its name and an extra follow
SURVEY_BYTES = 1 << 24  # of positions that are looked at together


def open_npz(path: Path, options: ReadOptions) -> FrameSource:
    """The sequence that `read_npz` gives, whose positions stay in the file if they can.

    They can if they lie there plainly: not compressed, frame after frame. Then all of them are
    read once now, some at a time, for their extent and to check them against the archive's sum.

    Parameters
    ----------
    path : Path
        As in `read_npz`.
    options : ReadOptions

    Raises
    ------
    FormatError, InvalidInputError
        As `read_npz`; when frames are read too, if the file has changed meanwhile.
    """
    with archive_errors(path):
        stored = _find_vertices(path, options)
    if stored is None:
        sequence = read_npz(path, options)
        options.progress("reading", 1.0)
        return sequence
    positions = options.dataset or POSITIONS
    arrays = read_arrays(path, positions, options.notes, with_positions=False)
    survey = FrameSurvey()
    for start, vertices in stored.survey():
        with errors_naming(path):
            validate_finite(vertices, first_frame=start)
        survey.add(vertices)
        options.progress("reading", Count(start + len(vertices), stored.n_frames, "frames"))
    with errors_naming(path):
        about = read_description(arrays, path.stem, options)
        return StoredFrames(
            n_frames=stored.n_frames,
            n_verts=stored.n_verts,
            faces=about.faces,
            fps=about.fps,
            name=about.name,
            dtype=survey.dtype,
            extent=survey.extent,
            read_range=stored.read,
            is_portable=True,
            start_s=about.start_s,
            surface=about.surface,
            files=(path,),
        )


@dataclass(frozen=True)
class _StoredVertices:
    """Positions of shape (T, V, 3) that lie plainly in a member of an archive.

    Attributes
    ----------
    path : Path
    member : str
    start_byte : int
        Where in the file the positions begin.
    n_frames, n_verts : int
    dtype : dtype
        As in the file, in whatever byte order.
    member_checksum : int
        CRC-32 of the whole member, as the archive says.
    checksums : list of int
        Of the member up to frame 0, up to frame 1, and so on; `survey` adds to it.
    """

    path: Path
    member: str
    start_byte: int
    n_frames: int
    n_verts: int
    dtype: np.dtype[Any]
    member_checksum: int
    checksums: list[int] = field(repr=False)

    def survey(self) -> Iterator[tuple[int, Vertices]]:
        """All positions, as blocks with the number of their first frame.

        Raises
        ------
        FormatError
            When all have been seen, if they are not what was written into the archive.
        """
        n_at_once = max(1, SURVEY_BYTES // (self.n_verts * 3 * self.dtype.itemsize))
        for start in range(0, self.n_frames, n_at_once):
            vertices = self._read(start, min(start + n_at_once, self.n_frames))
            for frame in vertices:
                self.checksums.append(zlib.crc32(frame, self.checksums[-1]))
            yield start, vertices.astype(self.dtype.newbyteorder("="), copy=False)
        if self.checksums[-1] != self.member_checksum:
            raise FormatError(
                f"{self.path}: is damaged: {self.member} does not have its checksum; save it again"
            )

    def read(self, start: int, stop: int) -> Vertices:
        """Positions of frames start..stop - 1, as they were when they were surveyed."""
        vertices = self._read(start, stop)
        for index, frame in enumerate(vertices, start):
            if zlib.crc32(frame, self.checksums[index]) != self.checksums[index + 1]:
                raise changed_error(f"{self.path} (frame {index})")
        return vertices.astype(self.dtype.newbyteorder("="), copy=False)

    def _read(self, start: int, stop: int) -> npt.NDArray[Any]:
        width = self.n_verts * 3
        offset = self.start_byte + start * width * self.dtype.itemsize
        with os_errors_naming(self.path):
            numbers = np.fromfile(self.path, self.dtype, (stop - start) * width, offset=offset)
        if len(numbers) < (stop - start) * width:
            raise changed_error(f"{self.path} (frame {start + len(numbers) // width})")
        return numbers.reshape(-1, self.n_verts, 3)


def _find_vertices(path: Path, options: ReadOptions) -> _StoredVertices | None:
    """Where the vertices lie; None if they must be loaded, and are checked there."""
    member, most = f"{options.dataset or POSITIONS}.npy", options.max_loaded_bytes
    if most is None:
        return None
    with zipfile.ZipFile(path) as archive:
        if member not in archive.namelist():
            return None
        info = archive.getinfo(member)
        header = read_array_header(archive, info)
    is_plain = info.compress_type == zipfile.ZIP_STORED and not header.is_fortran_ordered
    is_float = header.dtype.kind == "f" and header.dtype.itemsize in (4, 8)
    if not (is_plain and is_float and _is_frames_first(header.shape)):
        return None
    if info.file_size - header.size_bytes <= most:
        return None
    with path.open("rb") as stream:
        stream.seek(info.header_offset)
        lengths = LOCAL_HEADER.unpack(stream.read(LOCAL_HEADER.size))
        start_byte = stream.seek(sum(lengths), 1)
        checksum = zlib.crc32(stream.read(header.size_bytes))
    if start_byte + info.file_size > path.stat().st_size:
        raise FormatError(f"{member} ends behind the end of the file")
    return _StoredVertices(
        path,
        member,
        start_byte + header.size_bytes,
        header.shape[0],
        header.shape[1],
        header.dtype,
        info.CRC,
        [checksum],
    )


def _is_frames_first(shape: tuple[int, ...]) -> bool:
    """Whether positions are (T, V, 3) and nothing else; what may be another is loaded."""
    return has_positions(shape) and shape[2] == 3 != shape[1]
