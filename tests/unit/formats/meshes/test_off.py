import numpy as np
import pytest

from meshreel.errors import FormatError
from meshreel.formats.load import load
from meshreel.formats.meshes.off import read_off
from meshreel.model.surface import Domain, Kind
from meshreel.operations.save import save
from samples.surfaces import attribute, rich_cube

BODY = b"0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"


@pytest.mark.parametrize(
    "header",
    [
        b"OFF\n3 1 3\n",
        b"OFF 3 1 3\n",
        b"OFF\n3 1\n",
        b"# by hand\nOFF # yes\n\n# counts\n3 1 0 # here\n",
        b"3 1 0\n",
        b"COFF\r\n3 1 0\r\n",
        b"STCNOFF\n3 1 0\n",
        b"\t  OFF3 1 3 # or nah\n",
        b"COFF3 1\n",
    ],
)
def test_parse_off_reads_every_kind_of_header(header):
    mesh = read_off(header + BODY).mesh
    assert (mesh.vertices.tolist(), mesh.corners.tolist()) == (
        [[0, 0, 0], [1, 0, 0], [0, 1, 0]],
        [0, 1, 2],
    )


def test_parse_off_ignores_colors():
    data = b"COFF\n3 1 0\n0 0 0 255 0 0 255\n1 0 0 1 1 1 1\n0 1 0 0 0 0 0\n3 0 1 2 0.5 0.25 1\n"
    mesh = read_off(data).mesh
    assert (mesh.vertices[1].tolist(), mesh.corners.tolist()) == ([1, 0, 0], [0, 1, 2])


def test_parse_off_reads_mixed_polygons():
    data = b"OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3 9\n3 3 2 1\n"
    mesh = read_off(data).mesh
    assert (mesh.counts.tolist(), mesh.corners.tolist()) == ([4, 3], [0, 1, 2, 3, 3, 2, 1])


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "is empty"),
        (b"ply\n3 1 0\n" + BODY, "line 1: expected OFF"),
        (b"4OFF\n3 1 0\n" + BODY, "line 1: expected OFF"),
        (b"OFF BINARY\n3 1 0\n" + BODY, "line 1: expected the numbers of vertices and faces"),
        (b"OFF\n", "line 1: expected the numbers of vertices and faces"),
        (b"OFF3\n" + BODY, "line 1: expected the numbers of vertices and faces"),
        (b"OFF3 -1 0\n" + BODY, "line 1: counts must not be negative"),
        (b"OFF3 x 0\n" + BODY, "line 1: expected an integer; got 'x'"),
        (b"OFF\n3 -1 0\n" + BODY, "line 2: counts must not be negative"),
        (b"OFF\n3 2 0\n" + BODY, "declares 3 vertices and 2 faces.* but 4 lines follow"),
        (b"OFF\n3 0 0\n" + BODY, "declares 3 vertices and 0 faces.* but 4 lines follow"),
        (b"OFF\n9999999999999 1 0\n" + BODY, "but 4 lines follow"),
        (b"OFF\n2 2 0\n" + BODY, "line 5: declares 0 corners; 2 numbers follow|three corners"),
        (b"OFF\n3 1 0\n0 0\n1 0 0\n0 1 0\n3 0 1 2", "line 3: a vertex needs x, y and z; got 2"),
        (b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n4 0 1 2", "line 6: declares 4 corners; 3 numbers"),
        (b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3", "line 6: uses vertex 3"),
        (b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 x", "line 6: expected an integer; got 'x'"),
        (
            b"COFF\n3 1 0\n0 0 0 1 2 3\n0 0 0 red 0 0\n0 0 0 1 2 3\n3 0 1 2",
            "line 4: expected a number; got 'red'",
        ),
    ],
)
def test_parse_off_error_names_the_line(data, message):
    with pytest.raises(FormatError, match=message):
        read_off(data)


def triangle(keyword, *columns, face=""):
    rows = "".join(f"{row}\n" for row in columns)
    return f"{keyword}\n3 1 0\n{rows}3 0 1 2 {face}\n".encode()


def attributes(data):
    return [
        (attribute.kind, attribute.domain, attribute.values.tolist())
        for attribute in read_off(data).surface.attributes
    ]


@pytest.mark.parametrize(
    ("rows", "dtype", "expected"),
    [
        (["255 0 1", "0 7 0", "0 0 9"], np.uint8, [[255, 0, 1], [0, 7, 0], [0, 0, 9]]),
        (["1 0 1 1"] * 3, np.uint8, [[1, 0, 1, 1]] * 3),
        (["1.0 0 1"] * 3, np.float32, [[1, 0, 1]] * 3),
        ([".5 0 1"] * 3, np.float32, [[0.5, 0, 1]] * 3),
        (["256 0 1"] * 3, np.float32, [[256, 0, 1]] * 3),
    ],
)
def test_colors_without_decimal_point_are_bytes(rows, dtype, expected):
    data = triangle("COFF", *(f"{index}.5 0 0 {row}" for index, row in enumerate(rows)))
    (color,) = read_off(data).surface.attributes
    assert (color.values.dtype, color.values.tolist()) == (dtype, expected)


def test_keyword_selects_the_columns():
    rows = [f"{index} 0 0 9 9 9 0.5 0.25 0 1 {index} 7" for index in range(3)]
    assert attributes(triangle("STCNOFF", *rows)) == [
        (Kind.COLOR, Domain.VERTEX, [[0.5, 0.25, 0, 1]] * 3),
        (Kind.UV, Domain.VERTEX, [[0, 7], [1, 7], [2, 7]]),
    ]


@pytest.mark.parametrize(
    ("face", "expected"),
    [
        ("1 2 3", [(Kind.COLOR, Domain.FACE, [[1, 2, 3]])]),
        ("0.5 0.5 0.5 1", [(Kind.COLOR, Domain.FACE, [[0.5, 0.5, 0.5, 1]])]),
        ("7", []),
        ("", []),
    ],
)
def test_face_colors_have_three_or_four_numbers(face, expected):
    assert attributes(triangle("OFF", "0 0 0", "1 0 0", "0 1 0", face=face)) == expected


def test_extra_columns_without_keyword_are_ignored():
    assert attributes(triangle("OFF", *["0 0 0 1 2 3"] * 3)) == []


def test_colors_of_only_some_vertices_are_ignored():
    assert attributes(triangle("COFF", "0 0 0 1 2 3", "0 0 0", "0 0 0 1 2 3")) == []


def test_integral_float_colors_stay_floats(tmp_path):
    ones = attribute(Kind.COLOR, "vertex", 3)
    ones.values[:] = 1
    (path,) = save(rich_cube(1, attributes=[ones]), tmp_path / "f.off")
    np.testing.assert_array_equal(
        load(path).surface.attributes[0].values, np.ones((8, 3), np.float32), strict=True
    )
