import numpy as np
import pytest

from meshreel.errors import FormatError
from meshreel.formats.meshes.obj import read_obj
from meshreel.formats.meshes.obj_writing import obj_encoder
from samples.meshes import encoded

TRIANGLE = b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def corners(data):
    return read_obj(data).mesh.corners.tolist()


def test_extreme_floats_round_trip_exactly():
    tiny, huge = np.finfo(np.float32).smallest_subnormal, np.finfo(np.float32).max
    vertices = np.array([[tiny, -huge, -0.0], [1 / 3, 1e-10, 16777217.0], [0, 1, 2]], np.float32)
    mesh = read_obj(encoded(obj_encoder, vertices, [[0, 1, 2]])).mesh
    assert mesh.vertices.astype(np.float32).tobytes() == vertices.tobytes()


@pytest.mark.parametrize(
    "face",
    [b"f 1 2 3", b"f 1/1 2/2 3/3", b"f 1//7 2//7 3//7", b"f 1/9/7 2/9/7 3/9/7", b"f 1/ 2 3//4"],
)
def test_parse_obj_ignores_indices_after_slashes(face):
    assert corners(TRIANGLE + face) == [0, 1, 2]


def test_negative_indices_count_back_from_their_line():
    data = TRIANGLE + b"f -3 -2 -1\nv 5 5 5\nf -4 -3 -1\n"
    assert corners(data) == [0, 1, 2, 0, 1, 3]


def test_parse_obj_ignores_columns_after_z():
    data = b"v 0 1 2 1.0\nv 3 4 5\nv 6 7 8 0.5 0.5 0.5\nf 1 2 3"
    assert read_obj(data).mesh.vertices.tolist() == [[0, 1, 2], [3, 4, 5], [6, 7, 8]]


def test_parse_obj_ignores_other_statements():
    data = (
        b"mtllib a.mtl\no thing\nv 0 0 0\nvn 0 0 1\nv 1 0 0\nvt 0 0\nv 0 1 0 # last\n"
        b"g v f\ns off\nusemtl f 1 2 3\nl 1 2\np 1\nf 1 2 3\nvp 0.5\n\n"
    )
    mesh = read_obj(data).mesh
    assert (mesh.vertices.tolist(), mesh.corners.tolist()) == (
        [[0, 0, 0], [1, 0, 0], [0, 1, 0]],
        [0, 1, 2],
    )


def test_parse_obj_keeps_unused_vertices():
    assert len(read_obj(b"v 9 9 9\n" + TRIANGLE + b"f 2 3 4").mesh.vertices) == 4


def test_parse_obj_reads_faces_before_vertices():
    assert corners(b"f 1 2 3\n" + TRIANGLE) == [0, 1, 2]


def test_parse_obj_reads_continued_lines():
    data = TRIANGLE + b"v 1 1 0\r\nf 1 2 \\\r\n4 3\r\n"
    mesh = read_obj(data).mesh
    assert (mesh.counts.tolist(), mesh.corners.tolist()) == ([4], [0, 1, 3, 2])


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"v 0 0\nf 1 1 1", "line 1: a vertex needs x, y and z; got 2 numbers"),
        (TRIANGLE + b"f 1 2 4", r"line 4: uses vertex 4; indices must be in 1\.\.3"),
        (TRIANGLE + b"f 1 2 0", "line 4: uses vertex 0;"),
        (TRIANGLE + b"f 1 2 -4", "line 4: uses vertex -4;"),
        (TRIANGLE + b"\nf 1 2", "line 5: a face needs at least three corners; got 2"),
        (TRIANGLE + b"f", "line 4: a face needs at least three corners; got 0"),
        (TRIANGLE + b"f 1 b 3", "line 4: expected an integer; got 'b'"),
        (TRIANGLE + b"f 1 /2 3", "line 4: expected an integer; got '/2'"),
        (b"v 0 zero 0\nf 1 1 1", "line 1: expected a number; got 'zero'"),
        (TRIANGLE + b"vt x 0\nf 1/1 2/1 3/1\n", "line 4: expected a number; got 'x'"),
        (TRIANGLE + b"vt 0 0\n\nf 1/1 2/x 3/1\n", "line 6: expected an integer; got 'x'"),
        (TRIANGLE, "holds 3 vertices and 0 faces"),
        (b"\x89PNG\r\n\x1a\n\0\0\0", "holds 0 vertices and 0 faces"),
    ],
)
def test_parse_obj_error_names_the_line(data, message):
    with pytest.raises(FormatError, match=message):
        read_obj(data)
