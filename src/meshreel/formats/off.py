"""Object File Format (OFF): the vertices and faces of one frame.

Our own reader: it comes nearly free with the one for OBJ, keeps polygons, and checks the declared
counts. Read: the header words ``OFF``, ``COFF``, ``NOFF``, ``STOFF`` and their combinations, or
none; counts on the header's line or the next; one vertex or face a line, with colours, normals
and texture coordinates passed over. Not read: ``4OFF``, ``nOFF`` (other dimensions) and binary.
"""

import re
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.decimal_text import face_rows, vertex_rows
from meshreel.formats.polygons import PolygonMesh, polygon_mesh
from meshreel.formats.token_lines import TokenLines, split_lines
from meshreel.geometry.ragged import ragged_indices
from meshreel.sequence import Faces, Vertices
from meshreel.surface import PLAIN, Surface


def parse_off(data: bytes) -> PolygonMesh:
    """The mesh of the bytes of an OFF file; positions in float64.

    Raises
    ------
    FormatError
        Naming the line that is wrong, or if there are more or fewer lines than declared.
    """
    lines = split_lines(data)
    n_verts, n_faces, begin = _header(lines)
    if n_verts + n_faces != lines.n_lines - begin:
        raise FormatError(
            f"declares {n_verts} vertices and {n_faces} faces, one a line, but "
            f"{lines.n_lines - begin} lines follow; the file is truncated or damaged"
        )
    vertices = _vertices(lines, np.arange(begin, begin + n_verts))
    face_lines = np.arange(begin + n_verts, lines.n_lines)
    counts = _corner_counts(lines, face_lines)
    corners = lines.integers(ragged_indices(lines.first[face_lines] + 1, counts))
    return polygon_mesh(vertices, counts, corners, place=lambda face: lines.place(face_lines[face]))


def off_encoder(faces: Faces, surface: Surface = PLAIN) -> Callable[[Vertices], bytes]:
    """A function from the positions of a frame, of shape (V, 3), to the bytes of its OFF file.

    Float32 and float64 positions read back exactly. The faces are written out once.
    """
    face_text = face_rows(faces, prefix="3 ")

    def encode(vertices: Vertices) -> bytes:
        header = f"OFF\n{len(vertices)} {len(faces)} 0\n".encode("ascii")
        return header + vertex_rows(vertices) + face_text

    return encode


def _header(lines: TokenLines) -> tuple[int, int, int]:
    """Number of vertices, number of faces, and the first line after them."""
    if lines.n_lines == 0:
        raise FormatError("is empty; expected the word OFF")
    keyword = lines.word(0)
    n_words = 0 if keyword.lstrip("+").isdigit() else 1
    if n_words and not re.fullmatch(r"(ST)?C?N?OFF", keyword):
        raise FormatError(
            f"{lines.place(0)}: expected the word OFF (with C, N or ST before it); got {keyword!r}"
        )
    line = 1 if lines.counts[0] == n_words else 0
    offset = 0 if line else n_words
    if line == lines.n_lines or lines.counts[line] < offset + 2:
        raise FormatError(f"{lines.place(0)}: expected the numbers of vertices and faces after it")
    n_verts, n_faces = lines.integers(lines.first[line] + offset + np.arange(2)).tolist()
    if n_verts < 0 or n_faces < 0:
        raise FormatError(f"{lines.place(line)}: counts must not be negative")
    return n_verts, n_faces, line + 1


def _vertices(lines: TokenLines, vertex_lines: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
    short = lines.counts[vertex_lines] < 3
    if short.any():
        line = vertex_lines[np.argmax(short)]
        raise FormatError(
            f"{lines.place(line)}: a vertex needs x, y and z; got {lines.counts[line]} numbers"
        )
    return lines.floats(lines.first[vertex_lines][:, None] + np.arange(3))


def _corner_counts(lines: TokenLines, face_lines: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
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
