import struct

import numpy as np
import pytest

from meshreel.errors import FormatError
from meshreel.formats.meshes.ply import read_ply

QUAD = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.1]])


def header(encoding="ascii", *, number="float", n_verts=4, n_faces=2, before="", face=""):
    return (
        f"ply\nformat {encoding} 1.0\ncomment made by hand\nobj_info none\n{before}"
        f"element vertex {n_verts}\nproperty {number} x\nproperty {number} y\n"
        f"property {number} z\nelement face {n_faces}\n"
        f"{face or 'property list uchar int vertex_indices'}\nend_header\n"
    ).encode()


def binary_faces(order, faces):
    return b"".join(struct.pack(f"{order}B{len(face)}i", len(face), *face) for face in faces)


ASCII_VERTICES = b"0 0 0\n1 0 0\n1 1 0\n0 1 0.1\n"


@pytest.mark.parametrize(("number", "dtype"), [("float", "f4"), ("double", "f8")])
@pytest.mark.parametrize(
    ("encoding", "order"), [("binary_little_endian", "<"), ("binary_big_endian", ">")]
)
@pytest.mark.parametrize(
    "faces",
    [
        [(0, 1, 2), (0, 2, 3)],
        [(0, 1, 2, 3), (3, 1, 2)],
        [(0, 1, 2), (0, 2, 3), (0, 1, 3), (3, 1, 2)],  # fewer corners than faces: read by columns
    ],
)
def test_parse_ply_reads_binary_positions_and_lists(number, dtype, encoding, order, faces):
    body = QUAD.astype(order + dtype).tobytes() + binary_faces(order, faces)
    mesh = read_ply(header(encoding, number=number, n_faces=len(faces)) + body).mesh
    assert mesh.vertices.dtype == dtype
    np.testing.assert_array_equal(mesh.vertices, QUAD.astype(dtype))
    assert mesh.counts.tolist() == [len(face) for face in faces]
    assert mesh.corners.tolist() == [corner for face in faces for corner in face]


@pytest.mark.parametrize(
    "strips", [[(0, 1, 3, 2, -1, 2, 3, 0, 0, 1)], [(0, 1, 3, 2), (2, 3, 0, 0, 1)]]
)
def test_strips_become_triangles_without_degenerate_ones(strips):
    lists = header("binary_little_endian", n_faces=len(strips)).replace(
        b"element face", b"element tristrips"
    )
    file = read_ply(lists + QUAD.astype("<f4").tobytes() + binary_faces("<", strips))
    assert file.mesh.counts.tolist() == [3, 3, 3]
    assert file.mesh.corners.reshape(-1, 3).tolist() == [[0, 1, 3], [3, 1, 2], [2, 3, 0]]
    assert file.notes == []


@pytest.mark.parametrize(("number", "dtype"), [("float", "f4"), ("float64", "f8"), ("uchar", "f4")])
def test_ascii_positions_keep_the_declared_type(number, dtype):
    vertices = ASCII_VERTICES if number != "uchar" else b"0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
    mesh = read_ply(header(number=number) + vertices + b"3 0 1 2\n3 0 2 3\n").mesh
    assert mesh.vertices.dtype == dtype


def test_parse_ply_reads_ascii_polygons():
    mesh = read_ply(header() + ASCII_VERTICES + b"4 0 1 2 3\n3 3 1 2\n").mesh
    assert (mesh.counts.tolist(), mesh.corners.tolist()) == ([4, 3], [0, 1, 2, 3, 3, 1, 2])


@pytest.mark.parametrize("line_end", [b"\r\n", b"\r"])
def test_header_lines_may_end_with_cr_or_crlf(line_end):
    body = QUAD.astype("<f4").tobytes() + binary_faces("<", [(0, 1, 2), (0, 2, 3)])
    data = header("binary_little_endian").replace(b"\n", line_end) + body
    assert read_ply(data).mesh.corners.tolist() == [0, 1, 2, 0, 2, 3]


def test_parse_ply_skips_other_elements_and_properties():
    before = "element camera 2\nproperty double f\nproperty list uchar short knots\n"
    face = (
        "property uchar red\nproperty list int float texcoord\n"
        "property list ushort uint vertex_index\nproperty short flag"
    )
    cameras = struct.pack("<dB2h", 1, 2, 5, 6) + struct.pack("<dB", 1, 0)
    faces = b"".join(
        struct.pack(f"<Bi{len(uv)}fH3Ih", 7, len(uv), *uv, 3, *abc, -1)
        for uv, abc in [((0.5,) * 6, (0, 1, 2)), ((), (0, 2, 3))]
    )
    data = header("binary_little_endian", before=before, face=face)
    mesh = read_ply(data + cameras + QUAD.astype("<f4").tobytes() + faces).mesh
    np.testing.assert_array_equal(mesh.vertices, QUAD.astype(np.float32))
    assert mesh.corners.tolist() == [0, 1, 2, 0, 2, 3]


def test_parse_ply_finds_x_y_z_by_name():
    data = (
        b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float nx\nproperty float z\n"
        b"property float y\nproperty double x\nelement face 1\n"
        b"property list uchar int vertex_indices\nend_header\n"
        b"9 3 2 1\n9 6 5 4\n9 9 8 7\n3 0 1 2\n"
    )
    assert read_ply(data).mesh.vertices.tolist() == [[1, 2, 3], [4, 5, 6], [7, 8, 9]]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"solid x\n", "it is not a PLY file"),
        (b"ply\nformat ascii 1.0\n", "no line 'end_header'"),
        (header().replace(b"format ascii 1.0\n", b""), "no format line; expected one of ascii"),
        (header().replace(b"ascii", b"binary"), "line 2: 'format binary 1.0' is not a line"),
        (header().replace(b"float x", b"real x"), "line 6: 'real' is not a PLY type"),
        (header().replace(b"float y", b"float x"), "line 7: property 'x' is declared twice"),
        (header().replace(b"uchar int", b"float int"), "length of a list must be an integer"),
        (header().replace(b"vertex 4", b"vertex -4"), "line 5: 'element vertex -4' is not a line"),
        (
            header().replace(b"element face", b"element strips"),
            "has elements vertex, strips; a mesh needs 'vertex', and 'face' or 'tristrips'",
        ),
        (
            header().replace(b"float z", b"float w") + ASCII_VERTICES + b"3 0 1 2\n3 0 1 2\n",
            "element 'vertex' needs a property z; it has x, y, w",
        ),
        (
            header(face="property list uchar int strip") + ASCII_VERTICES + b"3 0 1 2\n3 0 1 2",
            "needs a property vertex_indices or vertex_index; it has strip",
        ),
        (header() + ASCII_VERTICES + b"3 0 1 2\n", "element 'face' with 2 rows is longer than"),
        (header() + ASCII_VERTICES + b"3 0 1 2\n3 0 1 4", "face 1: uses vertex 4"),
        (header() + ASCII_VERTICES + b"3 0 1 2\n3 0 1 x", "line 17: expected a number; got 'x'"),
        (header() + ASCII_VERTICES + b"3 0 1 2\n3 0 1 .5", "line 17: expected int32; got 0.5"),
        (header() + ASCII_VERTICES + b"3 0 1 2\n-3 0 1 2", "line 17: expected uint8; got -3"),
        (header("binary_little_endian", n_verts=10**15), "element 'vertex' with 10{15} rows is lo"),
        (
            header("binary_little_endian", face="property list char int vertex_indices")
            + bytes(48)
            + b"\xff" * 40,
            "element 'face' has a list of -1 values",
        ),
    ],
)
def test_parse_ply_explains_errors(data, message):
    with pytest.raises(FormatError, match=message):
        read_ply(data)
