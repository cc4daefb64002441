"""Object File Format (OFF): the vertices and faces of one frame.

Our own reader: it comes nearly free with the one for OBJ, keeps polygons, and checks the declared
counts. Read: the header words ``OFF``, ``COFF``, ``NOFF``, ``STOFF`` and their combinations, or
none; counts on the header's line, with a blank or without, or the next; one vertex or face a
line, of which `meshreel.formats.meshes.off_surface` reads colours and texture coordinates. Not
read: ``4OFF``, ``nOFF`` (other dimensions) and binary.
"""

import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.surfaces.polygons import PolygonMesh, polygon_mesh
from meshreel.formats.text.token_lines import TokenLines, split_lines
from meshreel.model.geometry.ragged import ragged_indices
from meshreel.model.sequence import Vertices
from meshreel.runtime.counting import counted


@dataclass(frozen=True)
class OffHeader:
    """The header word, the declared numbers, and the first line after them."""

    keyword: str
    n_verts: int
    n_faces: int
    begin: int

    @property
    def face_begin(self) -> int:
        """The line of the first face."""
        return self.begin + self.n_verts


def parse_off(data: bytes) -> PolygonMesh:
    """The mesh of the bytes of an OFF file; positions in float64.

    Raises
    ------
    FormatError
        Naming the line that is wrong, or if there are more or fewer lines than declared.
    """
    lines = split_lines(data)
    header = read_off_header(lines)
    n_lines = lines.n_lines - header.begin
    if header.n_verts + header.n_faces != n_lines:
        raise FormatError(
            f"declares {counted(header.n_verts, 'vertex')} and "
            f"{counted(header.n_faces, 'face')}, one a line, but "
            f"{n_lines} lines follow; the file is truncated or damaged"
        )
    vertices = _vertices(lines, np.arange(header.begin, header.face_begin))
    face_lines = np.arange(header.face_begin, lines.n_lines)
    counts = corner_counts(lines, face_lines)
    corners = lines.integers(ragged_indices(lines.first[face_lines] + 1, counts))
    return polygon_mesh(vertices, counts, corners, place=lambda face: lines.place(face_lines[face]))


def off_positions_like(first: bytes, mesh: PolygonMesh) -> Callable[[bytes], Vertices | None]:
    """A function from the bytes of another file to its positions, if its faces are the same text.

    It gives None for a file that must be read whole: faces are written otherwise, or something
    is wrong. Only the lines before the faces are read, which takes half of the time.
    """
    lines = split_lines(first)
    header = read_off_header(lines)
    faces = lines.physical[lines.starts[lines.first[header.face_begin]] : -1]

    def positions(data: bytes) -> Vertices | None:
        head = data.removesuffix(faces)
        if len(head) == len(data) or not head.endswith(b"\n"):
            return None
        lines = split_lines(head)
        with suppress(FormatError):  # reading it whole names the line
            if read_off_header(lines) == header and lines.n_lines == header.face_begin:
                return _vertices(lines, np.arange(header.begin, lines.n_lines))
        return None

    return positions


def read_off_header(lines: TokenLines) -> OffHeader:
    """The header of the lines of an OFF file; raises as `parse_off`."""
    if lines.n_lines == 0:
        raise FormatError("is empty; expected the word OFF")
    keyword = lines.word(0)
    n_words = 0 if keyword.lstrip("+").isdigit() else 1
    found = re.fullmatch(r"((?:ST)?C?N?OFF)(\d{0,15})", keyword)
    if n_words and not found:
        raise FormatError(
            f"{lines.place(0)}: expected the word OFF (with C, N or ST before it); got {keyword!r}"
        )
    if found and found[2]:
        return _joined_header(lines, found[1], int(found[2]))
    line = 1 if lines.counts[0] == n_words else 0
    offset = 0 if line else n_words
    if line == lines.n_lines or lines.counts[line] < offset + 2:
        raise FormatError(f"{lines.place(0)}: expected the numbers of vertices and faces after it")
    n_verts, n_faces = lines.integers(lines.first[line] + offset + np.arange(2)).tolist()
    if n_verts < 0 or n_faces < 0:
        raise FormatError(f"{lines.place(line)}: counts must not be negative")
    return OffHeader(keyword if n_words else "OFF", n_verts, n_faces, line + 1)


def _joined_header(lines: TokenLines, keyword: str, n_verts: int) -> OffHeader:
    """The header of a file with no blank between its word and the number of vertices."""
    if lines.counts[0] < 2:
        raise FormatError(f"{lines.place(0)}: expected the number of faces after that of vertices")
    [n_faces] = lines.integers(np.array([1])).tolist()
    if n_faces < 0:
        raise FormatError(f"{lines.place(0)}: counts must not be negative")
    return OffHeader(keyword, n_verts, n_faces, 1)


def _vertices(lines: TokenLines, vertex_lines: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
    short = lines.counts[vertex_lines] < 3
    if short.any():
        line = vertex_lines[np.argmax(short)]
        raise FormatError(
            f"{lines.place(line)}: a vertex needs x, y and z; got {lines.counts[line]} numbers"
        )
    return lines.floats(lines.first[vertex_lines][:, None] + np.arange(3))


def corner_counts(lines: TokenLines, face_lines: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """How many corners the faces on those lines have; raises as `parse_off`."""
    counts = lines.integers(lines.first[face_lines])
    wrong = (counts < 0) | (counts >= lines.counts[face_lines])
    if wrong.any():
        face = int(np.argmax(wrong))
        line = face_lines[face]
        raise FormatError(
            f"{lines.place(line)}: announces {counts[face]} corners; "
            f"{lines.counts[line] - 1} numbers follow"
        )
    return counts
