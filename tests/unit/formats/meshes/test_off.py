import pytest

from meshreel.errors import FormatError
from meshreel.formats.meshes.off import read_off

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
        (b"ply\n3 1 0\n" + BODY, "line 1: expected the word OFF"),
        (b"4OFF\n3 1 0\n" + BODY, "line 1: expected the word OFF"),
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
