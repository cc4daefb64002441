"""Wavefront OBJ: the vertices and faces of one frame.

Our own reader: the one of trimesh splits vertices at texture seams and leaves out those that no
face uses, so that frames could differ; a sequence needs them all, in file order. Read: ``v``
(columns after z ignored), ``f`` (only the vertex of ``v/vt/vn``; negative indices count back from
the last vertex above), comments, and a backslash that continues a line. Everything else is passed
over; `meshreel.formats.obj_surface` reads what of it is the same in every frame.
"""

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.polygons import PolygonMesh, polygon_mesh
from meshreel.formats.token_lines import TokenLines, split_lines


def parse_obj(data: bytes) -> PolygonMesh:
    """The mesh of the bytes of an OBJ file; positions in float64.

    Raises
    ------
    FormatError
        Naming the line that is wrong, or if there are no vertices or no faces.
    """
    return obj_mesh(split_lines(data, continuation=True))


def obj_mesh(lines: TokenLines) -> PolygonMesh:
    """The mesh of the lines of an OBJ file; as `parse_obj`."""
    is_vertex = lines.begins_with(b"v")
    face_lines = np.flatnonzero(lines.begins_with(b"f"))
    counts = lines.counts[face_lines] - 1
    tokens = ragged_indices(lines.first[face_lines] + 1, counts)
    written = lines.integers(tokens, stop_at_slash=True)
    n_above = np.repeat(np.cumsum(is_vertex)[face_lines], counts)
    vertices = _vertices(lines, np.flatnonzero(is_vertex))
    return polygon_mesh(
        vertices,
        counts,
        np.where(written < 0, n_above + written, written - 1),
        place=lambda face: lines.place(face_lines[face]),
        given=lambda corner: written[corner],
        allowed=f"1..{len(vertices)}, or count back with -1..-{len(vertices)}",
    )


def _vertices(lines: TokenLines, vertex_lines: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
    short = lines.counts[vertex_lines] < 4
    if short.any():
        line = vertex_lines[np.argmax(short)]
        raise FormatError(
            f"{lines.place(line)}: a vertex needs x, y and z; got {lines.counts[line] - 1} numbers"
        )
    return lines.floats(lines.first[vertex_lines][:, None] + np.arange(1, 4))
