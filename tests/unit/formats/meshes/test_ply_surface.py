import numpy as np
import pytest

from meshreel.errors import FormatError
from meshreel.formats.load import load
from meshreel.formats.meshes.ply import read_ply
from meshreel.formats.save import save
from meshreel.model.surface import Domain, Kind
from samples.surfaces import attribute, rich_cube


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
    data = triangle([f"uchar {name}" for name in RGB], ["0 1 2 3", "0 1 2 300", "0 1 2 3"])
    with pytest.raises(FormatError, match="line 14: expected uint8; got 300"):
        read_ply(data)


def test_indexed_values_are_expanded(tmp_path):
    color = attribute(Kind.COLOR, "vertex", 3, np.uint8, rows=3)
    (path,) = save(rich_cube(1, attributes=[color]), tmp_path / "f.ply")
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
