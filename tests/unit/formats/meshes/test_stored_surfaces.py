"""Surfaces that OBJ, OFF, PLY and STL files store, and notes on what they cannot store."""

import numpy as np
import pytest

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.load import load
from meshreel.formats.meshes.stl import read_stl, stl_encoder
from meshreel.model.surface import Kind
from meshreel.operations.save import save
from samples.meshes import assert_same_surface, encoded
from samples.surfaces import attribute, groups, rich_cube, two_cubes

BYTES = attribute(Kind.COLOR, "vertex", 4, np.uint8)
SURFACES = {
    "obj polygons": {},
    "obj texture": {"attributes": [attribute(Kind.UV, "corner", 2, rows=9)]},
    "obj colors": {"attributes": [attribute(Kind.COLOR, "vertex", 3, name="color")]},
    "obj materials": {"groups": [groups("material", ["a b", "50%", "c"], [-1, 0, 0, 1, -1, 0, 2])]},
    "obj all": {
        "attributes": [
            attribute(Kind.UV, "corner", 2, rows=40),
            attribute(Kind.COLOR, "vertex", 3, name="color"),
        ],
        "groups": [
            groups("material", ["m", "n"], [0, 0, 1, 1, 1, 0, 0]),
            groups("group", ["g"], [0, 0, 0, -1, -1, -1, 0]),
            groups("object", ["x", "y"], [0, 0, 1, 1, 0, 0, 0]),
        ],
    },
    "off polygons": {},
    "off bytes": {"attributes": [BYTES]},
    "off floats": {"attributes": [attribute(Kind.COLOR, "vertex", 3)]},
    "off faces": {"attributes": [attribute(Kind.COLOR, "face", 3, np.uint8)]},
    "off all": {
        "attributes": [
            attribute(Kind.COLOR, "vertex", 3, np.uint8),
            attribute(Kind.UV, "vertex", 2),
            attribute(Kind.COLOR, "face", 4),
        ]
    },
    "ply polygons": {},
    "ply bytes": {"attributes": [BYTES]},
    "ply texture": {"attributes": [attribute(Kind.UV, "vertex", 2)]},
    "ply corners": {"attributes": [attribute(Kind.UV, "corner", 2, np.float64)]},
    "ply all": {
        "attributes": [
            attribute(Kind.COLOR, "vertex", 3, np.uint8),
            attribute(Kind.UV, "vertex", 2, np.float64),
            attribute(Kind.OTHER, "vertex", 1, np.uint8, name="quality"),
            attribute(Kind.OTHER, "vertex", 1, np.int32, name="flags"),
            attribute(Kind.COLOR, "face", 4, np.uint8),
            attribute(Kind.OTHER, "face", 1, np.float64, name="area"),
            attribute(Kind.UV, "corner", 2),
        ]
    },
}


@pytest.mark.slow
@pytest.mark.every_case
@pytest.mark.parametrize("name", SURFACES)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_surface_round_trips_in_every_frame(tmp_path, name, dtype, notes):
    extension = name.split()[0]
    sequence = rich_cube(**SURFACES[name], dtype=dtype)
    paths = save(sequence, tmp_path / f"f_%d.{extension}", notes=notes)
    expected = sequence.vertices if extension == "ply" else sequence.vertices.astype(np.float32)
    for number, path in enumerate(paths):
        loaded = load(path)
        assert_same_surface(loaded.surface, sequence.surface)
        np.testing.assert_array_equal(loaded.vertices[0], expected[number], strict=True)
        np.testing.assert_array_equal(loaded.faces, sequence.faces)
    assert_same_surface(load(tmp_path).surface, sequence.surface)
    assert notes == []


MATERIAL = groups("material", "a", [0] * 7)
UNSUPPORTED = [
    (
        "obj",
        rich_cube(
            1,
            attributes=[attribute(Kind.OTHER, "vertex", 2, name="weight")],
            groups=[groups("skin", ["a"], [0] * 7)],
        ),
        "'weight' (other) of each vertex, groups 'skin'",
    ),
    (
        "off",
        rich_cube(1, attributes=[attribute(Kind.UV, "corner", 2, rows=4)], groups=[MATERIAL]),
        "'uv' (uv) of each corner, groups 'material'",
    ),
    ("off", two_cubes(1), "the names of 2 parts"),
    ("stl", rich_cube(1), "faces with more than three corners, which are triangulated"),
    ("ply", rich_cube(1, groups=[MATERIAL]), "groups 'material'"),
    ("ply", two_cubes(1), "the names of 2 parts"),
    *(
        ("ply", rich_cube(1, attributes=[other]), f"{other.name!r} ({other.kind}) of each {domain}")
        for domain, other in (
            ("vertex", attribute(Kind.OTHER, "vertex", 2, name="weights")),
            ("vertex", attribute(Kind.OTHER, "vertex", 1, name="two words")),
            ("vertex", attribute(Kind.OTHER, "vertex", 1, name="nx")),
            ("corner", attribute(Kind.OTHER, "corner", 1, name="weights")),
            ("corner", attribute(Kind.COLOR, "corner", 3)),
            ("face", attribute(Kind.UV, "face", 2)),
            ("vertex", attribute(Kind.UV, "vertex", 3)),
        )
    ),
]


@pytest.mark.every_case
@pytest.mark.parametrize(("extension", "sequence", "words"), UNSUPPORTED)
def test_save_notes_what_a_format_cannot_store(tmp_path, extension, sequence, words, notes):
    [path] = save(sequence, tmp_path / f"a.{extension}", notes=notes)
    assert load(path).surface.attributes == ()
    assert notes == [f"left out, as .{extension} files cannot store it: {words}"]


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


def test_parse_stl_reads_ascii_and_replaces_negative_zeros():
    vertices = read_stl(ASCII).mesh.vertices
    expected = [[0, 0, 0], [1, 0, 0], [0, 1.5, 0], [0, 0, 0], [1, 0, 0], [0, 0, 2]]
    assert vertices.tolist() == expected
    assert not np.signbit(vertices).any()


@pytest.mark.parametrize(("face", "normal"), [([0, 1, 2], [0, 0, 1]), ([0, 1, 1], [0, 0, 0])])
def test_stl_encoder_writes_unit_normals_or_zeros(face, normal):
    vertices = np.array([[0, 0, 0], [2, 0, 0], [0, 3, 0]], np.float64)
    data = encoded(stl_encoder, vertices, [face])
    assert np.frombuffer(data, "<f4", 3, 84).tolist() == normal


def test_a_note_says_that_stl_rounds_positions(tmp_path, notes):
    cube = rich_cube(1)
    save(cube.replace(vertices=cube.vertices / np.float64(3)), tmp_path / "a.stl", notes=notes)
    assert "STL stores positions as float32, to which these are rounded" in notes


def test_stl_encoder_rejects_positions_beyond_float32():
    with pytest.raises(InvalidInputError, match=r"STL stores float32"):
        encoded(stl_encoder, np.eye(3) * 1e39, [[0, 1, 2]])


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "is 0 bytes long; .* has 84"),
        (ASCII[:-20], "line 15: expected endsolid; the file"),
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
