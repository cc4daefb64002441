import numpy as np
import pytest

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.meshes.stl import read_stl, stl_encoder
from samples.meshes import encoded

ASCII = b"""solid a thing
  facet normal 0 0 1
    outer loop
      vertex 0 0 0
      vertex 1 0 0
      vertex 0 1.5e0 0
    endloop
  endfacet
  FACET NORMAL 0 0 0
    OUTER LOOP
      VERTEX -0 0 0
      VERTEX 1 0 0
      VERTEX 0 0 2
    ENDLOOP
  ENDFACET
endsolid a thing
"""


def test_corners_round_trip(make_sequence):
    sequence = make_sequence(1)
    mesh = read_stl(encoded(stl_encoder, sequence.vertices[0], sequence.faces)).mesh
    expected = sequence.vertices[0][sequence.faces].reshape(-1, 3)
    assert (mesh.vertices.dtype, mesh.vertices.tobytes()) == (np.float32, expected.tobytes())


def test_binary_header_may_begin_with_solid(make_sequence):
    sequence = make_sequence(1)
    data = encoded(stl_encoder, sequence.vertices[0], sequence.faces)
    assert len(read_stl(b"solid " + data[6:]).mesh.counts) == sequence.n_faces


def test_parse_stl_reads_ascii():
    expected = [[0, 0, 0], [1, 0, 0], [0, 1.5, 0], [0, 0, 0], [1, 0, 0], [0, 0, 2]]
    assert read_stl(ASCII).mesh.vertices.tolist() == expected


def test_parse_stl_replaces_negative_zeros():
    assert not np.signbit(read_stl(ASCII).mesh.vertices).any()


def test_stl_encoder_writes_unit_normals():
    vertices = np.array([[0, 0, 0], [2, 0, 0], [0, 3, 0]], np.float32)
    data = encoded(stl_encoder, vertices, [[0, 1, 2]])
    assert np.frombuffer(data, "<f4", 3, 84).tolist() == [0, 0, 1]


def test_degenerate_triangles_get_zero_normals():
    data = encoded(stl_encoder, np.eye(3, dtype=np.float64), [[0, 1, 1]])
    assert np.frombuffer(data, "<f4", 3, 84).tolist() == [0, 0, 0]


def test_stl_encoder_rejects_positions_beyond_float32():
    with pytest.raises(InvalidInputError, match=r"STL stores float32"):
        encoded(stl_encoder, np.eye(3) * 1e39, [[0, 1, 2]])


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "is 0 bytes long; .* has 84"),
        (ASCII[:-20], "line 15: expected endsolid at the end"),
        (b"solid\nendsolid\n", "holds 0 vertices and 0 faces"),
        (b"solid\nvertex 0 0 0\nendsolid", "line 2: a facet must have three vertex lines"),
        (ASCII.replace(b"VERTEX 1 0 0", b""), "line 9: a facet must have three vertex lines"),
        (ASCII.replace(b"VERTEX 1 0 0", b"VERTEX 1 0"), "line 12: a vertex needs exactly x, y"),
        (ASCII.replace(b"VERTEX 1 0 0", b"VERTEX 1 0 o"), "line 12: expected a number; got 'o'"),
    ],
)
def test_parse_stl_error_names_the_line(data, message):
    with pytest.raises(FormatError, match=message):
        read_stl(data)


@pytest.mark.parametrize("change", [lambda d: d[:-1], lambda d: d + b"\0", lambda d: d[:90]])
def test_parse_stl_rejects_sizes_that_contradict_the_count(make_sequence, change):
    sequence = make_sequence(1)
    data = encoded(stl_encoder, sequence.vertices[0], sequence.faces)
    with pytest.raises(
        FormatError, match=r"a binary STL with the declared .* has 484; the file is tr"
    ):
        read_stl(change(data))
