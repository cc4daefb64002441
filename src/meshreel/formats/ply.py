"""Polygon File Format (PLY): the vertices and faces of one frame.

Our own reader: the one of trimesh splits vertices at texture seams, reorders faces when quads and
triangles are mixed, cannot read binary files with lists of mixed length, and raises what numpy
raises on damaged files. Read: ASCII and both binary encodings, any further elements and
properties, faces of any size. Positions keep the declared type: double stays float64, integers
become a float type that holds them. Written: binary little endian, float or double.
"""

from collections.abc import Callable

import numpy as np

from meshreel.errors import FormatError
from meshreel.formats.ply_cells import BinaryCells, PlyCells, WordCells
from meshreel.formats.ply_header import PlyElement, PlyHeader, read_ply_header
from meshreel.formats.ply_layout import ElementLayout, list_values, locate_element
from meshreel.formats.polygons import PolygonMesh, polygon_mesh
from meshreel.formats.token_lines import split_lines
from meshreel.geometry.ragged import Integers, ragged_indices
from meshreel.sequence import Faces, Vertices
from meshreel.surface import PLAIN, Surface

INDEX_NAMES = ("vertex_indices", "vertex_index")
FACE = np.dtype([("count", "u1"), ("corners", "<i4", (3,))])


def parse_ply(data: bytes) -> PolygonMesh:
    """The mesh of the bytes of a PLY file.

    Raises
    ------
    FormatError
        If the header is wrong, the declared rows are not all there, or there are no faces.
    """
    header = read_ply_header(data)
    names = [element.name for element in header.elements]
    if "vertex" not in names or "face" not in names:
        raise FormatError(
            f"has elements {', '.join(names) or '(none)'}; a mesh needs 'vertex' and 'face' "
            "(triangle strips are not read)"
        )
    cells = _cells(header, data)
    layouts: dict[str, tuple[PlyElement, ElementLayout]] = {}
    start = 0
    for element in header.elements:
        layout = locate_element(element, cells, start)
        layouts.setdefault(element.name, (element, layout))
        start = layout.end
    counts, corners = _faces(*layouts["face"], cells)
    return polygon_mesh(_vertices(*layouts["vertex"], cells), counts, corners)


def ply_encoder(faces: Faces, surface: Surface = PLAIN) -> Callable[[Vertices], bytes]:
    """A function from the positions of a frame, of shape (V, 3), to the bytes of its PLY file.

    The file is binary little endian; float32 and float64 positions read back exactly. The faces
    are written out once.
    """
    rows = np.empty(len(faces), dtype=FACE)
    rows["count"], rows["corners"] = 3, faces
    face_bytes = rows.tobytes()

    def encode(vertices: Vertices) -> bytes:
        single = vertices.dtype == np.float32
        header = _written_header("float" if single else "double", len(vertices), len(faces))
        return header + vertices.astype("<f4" if single else "<f8").tobytes() + face_bytes

    return encode


def _written_header(number: str, n_verts: int, n_faces: int) -> bytes:
    axes = "".join(f"property {number} {axis}\n" for axis in "xyz")
    return (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {n_verts}\n{axes}"
        f"element face {n_faces}\nproperty list uchar int vertex_indices\nend_header\n"
    ).encode("ascii")


def _cells(header: PlyHeader, data: bytes) -> PlyCells:
    if header.encoding != "ascii":
        order = "<" if header.encoding == "binary_little_endian" else ">"
        return BinaryCells(data[header.body_start :], order)
    # The header goes through too, so that a wrong word is named with its line of the file.
    lines = split_lines(data)
    first = int(np.searchsorted(lines.starts, header.body_start))
    values = lines.floats(np.arange(first, len(lines.starts)))
    return WordCells(values, lambda cell: lines.place_of_word(first + cell))


def _vertices(element: PlyElement, layout: ElementLayout, cells: PlyCells) -> Vertices:
    columns = [element.property_named(axis) for axis in "xyz"]
    if any(column.count_code for column in columns):
        raise FormatError("element 'vertex' has a list where x, y or z should be a number")
    values = [cells.take(layout.offsets[column.name], column.code) for column in columns]
    dtype = np.result_type(np.float32, *(column.dtype for column in values))
    return np.stack(values, axis=1).astype(dtype)


def _faces(
    element: PlyElement, layout: ElementLayout, cells: PlyCells
) -> tuple[Integers, Integers]:
    column = element.property_named(*INDEX_NAMES)
    if not column.count_code or column.code.startswith("f"):
        raise FormatError(f"property {column.name!r} must be a list of integers")
    counts, starts = list_values(layout, cells, column)
    width = cells.width(column.code)
    cells_of_corners = np.repeat(starts, counts) + width * ragged_indices(0 * counts, counts)
    return counts, cells.take(cells_of_corners, column.code)
