import struct

import numpy as np
import pytest

from meshreel.errors import FormatError
from meshreel.formats.load import load
from meshreel.formats.meshes.ply import read_ply
from meshreel.model.surface import Domain, Kind
from meshreel.operations.save import save
from samples.surfaces import attribute, rich_cube

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
            "has elements vertex, strips; a mesh needs 'vertex' and 'face'",
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


LINES = (
    "ply", "format binary_little_endian 1.0", "element vertex 3", "property float x",
    "property float y", "property float z", "element face 1",
    "property list uchar int vertex_indices", "end_header",
)  # fmt: skip
VERTICES = np.array([[0.5, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")
FACE = b"\x03" + np.arange(3, dtype="<i4").tobytes()


def ply(line_end, last=None, lines=LINES, vertices=VERTICES):
    last = line_end if last is None else last
    return line_end.join(lines).encode() + last.encode() + vertices.tobytes() + FACE


@pytest.mark.parametrize(
    ("line_end", "last"), [("\n", "\r\n"), ("\r\n", "\n"), ("\n", "\n"), ("\r", "\r")]
)
def test_last_header_line_may_end_differently(line_end, last):
    mesh = read_ply(ply(line_end, last)).mesh
    assert (mesh.vertices.tobytes(), mesh.corners.tolist()) == (VERTICES.tobytes(), [0, 1, 2])


def test_line_feed_after_a_cr_header_is_data():
    vertices = VERTICES.copy()
    vertices.view(np.uint8)[0, 0] = ord("\n")
    mesh = read_ply(ply("\r", vertices=vertices)).mesh
    assert mesh.vertices.tobytes() == vertices.tobytes()


def test_unknown_header_lines_are_skipped_with_a_note(tmp_path, notes):
    path = tmp_path / "a.ply"
    path.write_bytes(ply("\n", lines=(*LINES[:2], "made by hand", *LINES[2:6], "#", *LINES[6:])))
    loaded = load(path, notes=notes)
    assert loaded.vertices.tobytes() == VERTICES.tobytes()
    assert notes == ["left out: lines of the header: line 3 'made by hand', line 8 '#'"]


@pytest.mark.parametrize("line", ["propetry float w", "element vertex x", "property float"])
def test_misspelled_properties_are_rejected(line):
    with pytest.raises(FormatError, match="line 7: "):
        read_ply(ply("\n", lines=(*LINES[:6], line, *LINES[6:])))


def test_skipped_lines_are_noted_once_for_several_segments(tmp_path, notes):
    lines = (*LINES[:2], "made by hand", *LINES[2:])
    (tmp_path / "0.ply").write_bytes(ply("\n", lines=lines))
    flipped = ply("\n", lines=lines)[: -len(FACE)] + FACE[:1] + np.array([0, 2, 1], "<i4").tobytes()
    (tmp_path / "1.ply").write_bytes(flipped)
    assert load(tmp_path, notes=notes).starts == (0, 1, 2)
    assert notes[0] == "left out: lines of the header: line 3 'made by hand'"
    assert sum("lines of the header" in note for note in notes) == 1


def triangle(vertex_properties, vertex_rows, face_properties=(), face_row=""):
    lines = ["ply", "format ascii 1.0", "element vertex 3"]
    lines += [f"property float {axis}" for axis in "xyz"]
    lines += [f"property {one}" for one in vertex_properties]
    lines += ["element face 1", "property list uchar int vertex_indices"]
    lines += [f"property {one}" for one in face_properties]
    lines += ["end_header", *(f"0 0 {row}" for row in vertex_rows), f"3 0 1 2 {face_row}"]
    return ("\n".join(lines) + "\n").encode()


def attributes(data):
    return [
        (
            attribute.name,
            attribute.kind,
            attribute.domain,
            attribute.values.dtype.str[1:],
            attribute.values.tolist(),
        )
        for attribute in read_ply(data).surface.attributes
    ]


RGB, RGBA = ["red", "green", "blue"], ["red", "green", "blue", "alpha"]


@pytest.mark.parametrize(("number", "code"), [("uchar", "u1"), ("float", "f4"), ("double", "f8")])
@pytest.mark.parametrize("names", [RGB, RGBA])
def test_parse_ply_surface_reads_vertex_colors(number, code, names):
    values = "1 0 1 1"[: 2 * len(names)]
    data = triangle([f"{number} {name}" for name in names], [f"0 {values}"] * 3)
    expected = [[1, 0, 1, 1][: len(names)]] * 3
    assert attributes(data) == [("color", Kind.COLOR, Domain.VERTEX, code, expected)]


@pytest.mark.parametrize("names", ["s t", "u v", "texture_u texture_v", "texture_s texture_t"])
def test_parse_ply_surface_reads_vertex_uv(names):
    data = triangle([f"float {name}" for name in names.split()], ["0 0.5 2"] * 3)
    assert attributes(data) == [("uv", Kind.UV, Domain.VERTEX, "f4", [[0.5, 2]] * 3)]


def test_parse_ply_surface_keeps_other_numbers():
    columns = ["float nx", "float confidence", "ushort flags", "uint id", "char a", "float red"]
    data = triangle(columns, ["0 9 .5 65535 4294967295 -1 1"] * 3, ["int label"], "-7")
    assert attributes(data) == [
        ("confidence", Kind.OTHER, Domain.VERTEX, "f4", [[0.5]] * 3),
        ("flags", Kind.OTHER, Domain.VERTEX, "i4", [[65535]] * 3),
        ("id", Kind.OTHER, Domain.VERTEX, "f8", [[4294967295]] * 3),
        ("a", Kind.OTHER, Domain.VERTEX, "i4", [[-1]] * 3),
        ("red", Kind.OTHER, Domain.VERTEX, "f4", [[1]] * 3),
        ("label", Kind.OTHER, Domain.FACE, "i4", [[-7]]),
    ]


def test_parse_ply_surface_reads_corner_uv():
    face = ["list uchar float texcoord", "uchar red", "uchar green", "uchar blue", "int texnumber"]
    assert attributes(triangle([], ["0"] * 3, face, "6 0 1 2 3 4 5 9 8 7 0")) == [
        ("color", Kind.COLOR, Domain.FACE, "u1", [[9, 8, 7]]),
        ("texnumber", Kind.OTHER, Domain.FACE, "i4", [[0]]),
        ("uv", Kind.UV, Domain.CORNER, "f4", [[0, 1], [2, 3], [4, 5]]),
    ]


@pytest.mark.parametrize("row", ["0", "2 0 1"])
def test_incomplete_corner_uv_are_ignored(row):
    assert attributes(triangle([], ["0"] * 3, ["list uchar float texcoord"], row)) == []


def test_error_names_the_line_of_a_color_out_of_range():
    data = triangle([f"uchar {name}" for name in RGB], ["0 1 2 255", "0 1 2 256", "0 1 2 3"])
    with pytest.raises(FormatError, match="line 14: expected uint8; got 256"):
        read_ply(data)


def test_indexed_values_are_expanded_and_colors_of_corners_left_out(tmp_path):
    color = attribute(Kind.COLOR, "vertex", 3, np.uint8, rows=3)
    paint = attribute(Kind.COLOR, "corner", 3, np.uint8)
    (path,) = save(rich_cube(1, attributes=[paint, color]), tmp_path / "f.ply")
    (result,) = load(path).surface.attributes
    np.testing.assert_array_equal(result.values, color.per_item(), strict=True)


def test_faces_may_have_more_than_255_corners(tmp_path):
    angle = np.linspace(0, 6, 300, dtype=np.float32)
    vertices = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    fan = np.stack([np.zeros(298), np.arange(1, 299), np.arange(2, 300)], axis=1).astype(int)
    cube = rich_cube(1)
    surface = type(cube.surface)(np.array([300]))
    disc = type(cube)(vertices[np.newaxis], fan, surface=surface)
    (path,) = save(disc, tmp_path / "f.ply")
    assert load(path).surface.face_sizes.tolist() == [300]
