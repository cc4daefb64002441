"""Wavefront OBJ: the vertices and faces of one frame.

Supports ``v`` (columns after z are ignored), ``f`` (only the vertex of ``v/vt/vn``; negative
indices count back from the last vertex above), comments, and a backslash that continues a line.
`meshreel.formats.meshes.obj_surface` reads attributes and groups; other statements are ignored.

trimesh is not used: it splits vertices at texture seams and drops unused ones, so frames could get
different vertices. A sequence needs all of them in file order.
"""

import re
from collections.abc import Callable
from contextlib import suppress

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.surfaces.polygons import PolygonMesh, polygon_mesh
from meshreel.formats.text.token_lines import TokenLines, split_lines
from meshreel.model.geometry.polygons import ragged_indices
from meshreel.model.sequence import Vertices

N_POSITION = 3
FIRST_VERTEX = re.compile(rb"^[ \t]*v[ \t]([^\r\n#]*)", re.MULTILINE)
FIELD_LINE = re.compile(rb"^[ \t]*(f|vt)[ \t]", re.MULTILINE)
END_OF_SEGMENT = re.compile(rb"\nv(?!t)")


def parse_obj(data: bytes) -> PolygonMesh:
    """Parse the mesh of an OBJ file; positions are float64.

    Raises
    ------
    FormatError
        If a line is invalid, which the error names, or vertices or faces are missing.
    """
    return obj_mesh(split_lines(data, continuation=True))


def obj_mesh(lines: TokenLines) -> PolygonMesh:
    """Return the mesh of the tokenized lines of an OBJ file; raises as `parse_obj`."""
    is_vertex = lines.begins_with(b"v")
    face_lines = np.flatnonzero(lines.begins_with(b"f"))
    counts = lines.counts[face_lines] - 1
    tokens = ragged_indices(lines.first[face_lines] + 1, counts)
    indices = lines.integers(tokens, stop_at_slash=True)
    n_above = np.repeat(np.cumsum(is_vertex)[face_lines], counts)
    vertices = _vertices(lines, np.flatnonzero(is_vertex))
    return polygon_mesh(
        vertices,
        counts,
        np.where(indices < 0, n_above + indices, indices - 1),
        place=lambda face: lines.place(face_lines[face]),
        given=lambda corner: indices[corner],
        allowed=f"1..{len(vertices)}, or count back with -1..-{len(vertices)}",
    )


def obj_positions_reader(first: bytes, mesh: PolygonMesh) -> Callable[[bytes], Vertices | None]:
    """Return a function that reads only the positions of files with the same face text as `first`.

    It takes the bytes of a file and returns None if the file must be parsed completely, because
    its faces or texture coordinates differ or it is damaged. Skipping the common text makes
    reading three times faster.
    """
    segments, n_verts = _constant_segments(first), len(mesh.vertices)
    counts_back = any(b" -" in segment for segment in segments)

    def positions(data: bytes) -> Vertices | None:
        if counts_back or b"\\" in data or (rest := _without(segments, data)) is None:
            return None
        lines = split_lines(rest)
        vertex_lines = np.flatnonzero(lines.begins_with(b"v"))
        if lines.begins_with(b"f").any() or len(vertex_lines) != n_verts:
            return None
        with suppress(FormatError):  # parsing the whole file reports the line
            return _vertices(lines, vertex_lines)
        return None

    return positions


def obj_fields_checker(first: bytes) -> Callable[[bytes], bool]:
    """Return a function that tells whether a file certainly has the same fields as `first`.

    It has if faces and texture coordinates are the same text, and neither file has normals or
    vertex colors.
    """
    segments = _constant_segments(first)
    counts_back = any(b" -" in segment for segment in segments)
    can_differ = not segments or counts_back or _has_normals_or_colors(first)

    def are_same(data: bytes) -> bool:
        if can_differ or _has_normals_or_colors(data) or b"\\" in data:
            return False
        rest = _without(segments, data)
        return rest is not None and FIELD_LINE.search(rest) is None

    return are_same


def _has_normals_or_colors(data: bytes) -> bool:
    """Whether the file has normals, or a first vertex with more than three numbers."""
    found = FIRST_VERTEX.search(data)
    return b"vn" in data or found is None or len(found[1].split()) > N_POSITION


def _constant_segments(data: bytes) -> list[bytes]:
    """Text segments that begin with a face or texture coordinate and end before a vertex."""
    segments, end = [], 0
    while (begin := _next_segment(data, end)) >= 0:
        found = END_OF_SEGMENT.search(data, begin)
        end = found.start() if found else len(data)
        segments.append(data[begin:end])
    return segments


def _next_segment(data: bytes, at: int) -> int:
    """Offset of the newline before the next face or texture coordinate; -1 if there is none."""
    face = _next_line(data, b"\nf ", at, len(data))
    texture = _next_line(data, b"\nvt ", at, face if face >= 0 else len(data))
    return texture if texture >= 0 else face


def _next_line(data: bytes, beginning: bytes, at: int, stop: int) -> int:
    """Offset of the next occurrence of a line beginning; -1 if there is none before `stop`."""
    # Searching for one letter that numbers do not contain is a hundred times faster than for two.
    letter = beginning[-2:-1]
    while (at := data.find(letter, at, stop) + 1) > 0:
        begin = at - len(beginning) + 1
        if begin >= 0 and data.startswith(beginning, begin):
            return begin
    return -1


def _without(segments: list[bytes], data: bytes) -> bytes | None:
    """Text between the segments; None if the data does not contain them all where they belong."""
    pieces, end = [], 0
    for segment in segments:
        begin = _next_segment(data, end)
        if begin < 0 or not data.startswith(segment, begin):
            return None
        pieces.append(data[end:begin])
        end = begin + len(segment)
        if not segment.endswith(b"\n") and data[end : end + 1] not in b"\n":
            return None
    return b"\n".join([*pieces, data[end:]])


def _vertices(lines: TokenLines, vertex_lines: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
    short = lines.counts[vertex_lines] < 4
    if short.any():
        line = vertex_lines[np.argmax(short)]
        raise FormatError(
            f"{lines.place(line)}: a vertex needs x, y and z; got {lines.counts[line] - 1} numbers"
        )
    return lines.floats(lines.first[vertex_lines][:, None] + np.arange(1, 4))
