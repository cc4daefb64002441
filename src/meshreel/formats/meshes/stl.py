"""STL, binary and ASCII: the triangles of one frame, where every corner has its own position.

Corners are read in file order, so that `meshreel.formats.surfaces.welding` can join the same ones
in every frame. Written files are binary: float64 positions are rounded to float32 (relative error
6e-8). Normals are ignored on reading and computed on writing.
"""

import re
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values
from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.frames.frame import Frame
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.kinds import Encode, FrameFormat
from meshreel.formats.surfaces.polygons import polygon_mesh
from meshreel.formats.text.token_lines import TokenLines, split_lines
from meshreel.model.notes import Notes, note_unwritten
from meshreel.model.sequence import Vertices

HEADER_BYTES = 80
TRIANGLE = np.dtype([("normal", "<f4", (3,)), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])

COLORED = re.compile(rb"(COLOR|MATERIAL)=")
"""What begins a color in the header; other text of the header is for people."""


def read_stl(data: bytes) -> Frame:
    """Read an STL file; corner 3 f + i is vertex 3 f + i.

    A note reports colors that some programs put into spare bytes.

    Raises
    ------
    FormatError
        If the size contradicts the declared number of triangles, or a line is invalid, which the
        error names.
    """
    # Some binary files begin with "solid" too, so the size decides first.
    corners: Vertices
    notes = Notes()
    if len(data) == _binary_size(data):
        triangles = np.frombuffer(data, dtype=TRIANGLE, offset=HEADER_BYTES + 4)
        corners = triangles["corners"].reshape(-1, 3).astype(np.float32)
        if triangles["attribute"].any():
            notes.left_out("spare bytes of triangles, such as colors")
        if COLORED.search(data, 0, HEADER_BYTES):
            notes.left_out("colors of the header")
    elif data.lstrip()[:5].lower() == b"solid" and b"\0" not in data:
        corners = _parse_ascii(split_lines(data.lower()))
        names = re.findall(rb"^\s*solid[ \t]+(\S[^\r\n]*?)\s*$", data, re.IGNORECASE | re.MULTILINE)
        notes.left_out("names of solids", (name.decode("latin-1") for name in names))
    else:
        raise FormatError(
            f"is {len(data)} bytes long; a binary STL with the declared number of triangles has "
            f"{_binary_size(data)}; the file is truncated or damaged"
        )
    with np.errstate(invalid="ignore"):
        corners = corners + 0.0  # without negative zeros, welding by bytes finds equal corners
    n_faces = len(corners) // 3
    return Frame(polygon_mesh(corners, np.full(n_faces, 3), np.arange(3 * n_faces)), notes=notes)


def stl_encoder(stream: FrameStream) -> Encode:
    """Return a function that encodes a frame as an STL file.

    Raises
    ------
    InvalidInputError
        From the function, if a position is too large for float32.
    """
    faces = stream.faces
    note_unwritten(stream.surface, (), ".stl", stream.notes, polygons=False)

    def encode(vertices: Vertices, values: Mapping[str, Values]) -> bytes:
        triangles = np.zeros(len(faces), dtype=TRIANGLE)
        with np.errstate(over="ignore"):
            triangles["corners"] = corners = vertices[faces]
        if not np.isfinite(triangles["corners"]).all():
            raise InvalidInputError(
                "STL stores float32, up to 3.4e38; a position is larger; write .ply instead"
            )
        if (triangles["corners"] != corners).any():
            stream.notes.changed(
                "positions", "STL stores positions as float32, to which these are rounded"
            )
        triangles["normal"] = _normals(corners.astype(np.float64))
        header = b"binary STL".ljust(HEADER_BYTES, b" ")
        return header + len(faces).to_bytes(4, "little") + triangles.tobytes()

    return encode


def _binary_size(data: bytes) -> int:
    n_faces = int.from_bytes(data[HEADER_BYTES : HEADER_BYTES + 4], "little")
    return HEADER_BYTES + 4 + n_faces * TRIANGLE.itemsize


def _parse_ascii(lines: TokenLines) -> npt.NDArray[np.float64]:
    facets, vertices = lines.beginning_with(b"facet"), lines.beginning_with(b"vertex")
    if lines.n_lines - 1 not in lines.beginning_with(b"endsolid"):
        raise FormatError(
            f"{lines.location(lines.n_lines - 1)}: expected endsolid; the file is truncated"
        )
    n_corners = np.bincount(np.searchsorted(facets, vertices), minlength=len(facets) + 1)
    if n_corners[0] or (n_corners[1:] != 3).any():
        line = vertices[0] if n_corners[0] else facets[np.argmax(n_corners[1:] != 3)]
        raise FormatError(f"{lines.location(line)}: a facet must have three vertex lines")
    is_wrong = lines.counts[vertices] != 4
    if is_wrong.any():
        raise FormatError(
            f"{lines.location(vertices[np.argmax(is_wrong)])}: a vertex needs exactly x, y and z"
        )
    return lines.floats(lines.first[vertices][:, None] + np.arange(1, 4))


def _normals(corners: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    with np.errstate(over="ignore", invalid="ignore"):
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        is_usable = (lengths > 0) & np.isfinite(lengths)
    unit = np.zeros_like(normals)
    np.divide(normals, lengths, out=unit, where=is_usable)
    return unit


FORMATS = (
    FrameFormat(".stl", "STL", read_stl, stl_encoder, is_decimal=True, has_unshared_vertices=True),
)
