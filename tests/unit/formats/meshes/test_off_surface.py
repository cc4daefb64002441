import numpy as np
import pytest

from meshreel.formats.load import load
from meshreel.formats.meshes.off import read_off
from meshreel.formats.save import save
from meshreel.model.surface import Domain, Kind
from samples.surfaces import attribute, rich_cube


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
