import numpy as np
import pytest

from meshreel.errors import FormatError
from meshreel.formats.load import load
from meshreel.formats.meshes.obj import read_obj
from meshreel.formats.meshes.obj_writing import obj_encoder
from meshreel.model.surface import Domain, Kind, Part, Surface
from meshreel.operations.save import save
from samples.meshes import assert_same_surface, encoded
from samples.surfaces import attribute, groups, rich_cube, two_cubes

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


SQUARE = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
UVS = b"vt 0 0\nvt 0.1 0\nvt 0.1 0.7\nvt 9 9\n"


def groups_of(data):
    return [
        (group.name, group.labels, group.numbers.tolist())
        for group in read_obj(data).surface.groups
    ]


def uv_rows(data):
    (uv,) = read_obj(data).surface.attributes
    return uv.values.tolist(), uv.indices.tolist()


def test_uv_table_keeps_shared_and_unused_rows():
    (uv,) = read_obj(SQUARE + UVS + b"f 1/1 2/2/9 3/3 4/1\n").surface.attributes
    assert (uv.name, uv.kind, uv.domain) == ("uv", Kind.UV, Domain.CORNER)
    expected = np.array([[0, 0], [0.1, 0], [0.1, 0.7], [9, 9]], np.float32)
    np.testing.assert_array_equal(uv.values, expected, strict=True)
    assert uv.indices.tolist() == [0, 1, 2, 0]


def test_negative_uv_indices_count_back_from_their_line():
    data = SQUARE + b"vt 1 2\nf 1/-1 2/-1 3/-1\nvt 3 4\nf 1/-1 3/-2 4/1\n"
    assert uv_rows(data) == ([[1, 2], [3, 4]], [0, 0, 0, 1, 0, 0])


def test_corners_without_uv_get_zeros():
    values, rows = uv_rows(SQUARE + b"vt 1 2\nf 1/1 2/1 3/1\nf 1 3//5 4/1\nf 1/0 2/2 3/-9\n")
    assert (values, rows) == ([[1, 2], [0, 0]], [0, 0, 0, 1, 1, 0, 1, 1, 1])


def test_one_dimensional_uv_has_v_0():
    assert uv_rows(SQUARE + b"vt 0.5\nvt 1 2 3\nf 1/1 2/2 3/2\n")[0] == [[0.5, 0], [1, 2]]


@pytest.mark.parametrize("face", [b"f 1 2 3", b"f 1//1 2//1 3//1", b"f 1/7 2/7 3/7", b"f 1/ 2/ 3/"])
def test_surface_without_corner_uv_is_plain(face):
    assert read_obj(SQUARE + UVS + face).surface.is_plain


@pytest.mark.parametrize(
    ("numbers", "expected"),
    [
        (["1 0.1 0", "0 0.2 1"], [[1, 0.1, 0], [0, 0.2, 1]]),
        (["255 0 51", "0 1 2"], np.array([[255, 0, 51], [0, 1, 2]]) / 255),
        (["0 1 0", "1 1 1"], [[0, 1, 0], [1, 1, 1]]),
        (["2.5 1 0", "1 1 1"], [[2.5, 1, 0], [1, 1, 1]]),
    ],
)
def test_parse_obj_surface_reads_vertex_colors(numbers, expected):
    text = "".join(f"v {index} 0 0 {row}\n" for index, row in enumerate(numbers))
    (color,) = read_obj(text.encode() + b"f 1 2 1\n").surface.attributes
    assert (color.kind, color.domain, color.indices) == (Kind.COLOR, Domain.VERTEX, None)
    np.testing.assert_array_equal(color.values, np.array(expected, np.float32), strict=True)


def test_colors_of_only_some_vertices_are_ignored():
    assert read_obj(b"v 0 0 0 1 1 1\nv 1 0 0\nv 2 0 0 1 1 1\nf 1 2 3\n").surface.is_plain


def test_usemtl_assigns_faces_to_materials():
    data = SQUARE + (
        b"f 1 2 3\nusemtl red  wood\nf 1 2 4\nusemtl unused\nusemtl b\nf 2 3 4\n"
        b"usemtl red wood\nf 1 2 3\nusemtl\nf 1 2 3\n"
    )
    assert groups_of(data) == [("material", ("red wood", "b"), [-1, 0, 1, 0, -1])]


def test_group_names_may_be_utf_8_or_latin_1():
    data = SQUARE + "g Gehäuse\nf 1 2 3\n".encode() + "g Gehäuse2\nf 1 2 3\n".encode("latin-1")
    assert groups_of(data) == [("group", ("Gehäuse", "Gehäuse2"), [0, 1])]


OBJECTS = b"o a\n" + SQUARE + b"f 1 2 3\no b\n" + SQUARE + b"f 5 6 7 8\nf -4 -3 -2\n"


def test_disjoint_objects_are_parts():
    result = read_obj(OBJECTS).surface
    assert result.parts == (Part("a", 4, 1), Part("b", 4, 2))
    assert result.groups == ()


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (OBJECTS + b"f 1 2 3\n", (("a", "b"), [0, 1, 1, 1])),
        (b"v 9 9 9\n" + OBJECTS.replace(b"-", b"-0"), (("a", "b"), [0, 1, 1])),
        (OBJECTS.replace(b"o b", b"o a") + b"o c\nf 1 2 3\n", (("a", "c"), [0, 0, 0, 1])),
        (OBJECTS.replace(b"o b", b"o"), (("a",), [0, -1, -1])),
        (SQUARE + b"o a\nf 1 2 3\no b\nf 2 3 4\n", (("a", "b"), [0, 1])),
    ],
)
def test_other_objects_are_groups(data, expected):
    assert groups_of(data) == [("object", *expected)]
    assert read_obj(data).surface.parts == ()


def test_single_object_is_a_group():
    assert groups_of(b"o a\n" + SQUARE + b"s 1\nf 1 2 3\no unused\n") == [("object", ("a",), [0])]


def test_obj_parts_round_trip(tmp_path):
    sequence = two_cubes()
    save(sequence, tmp_path / "f_%d.obj")
    loaded = load(tmp_path)
    assert_same_surface(loaded.surface, sequence.surface)
    np.testing.assert_array_equal(loaded.vertices, sequence.vertices)


def test_obj_encoder_restates_groups_for_each_part(tmp_path):
    sequence = two_cubes(1)
    material = groups("material", ["m"], [0] * 7 + [-1] * 7)
    surface = Surface(sequence.surface.face_sizes, (), (material,), sequence.surface.parts)
    rich = type(sequence)(sequence.vertices, sequence.faces, surface=surface)
    (path,) = save(rich, tmp_path / "f.obj")
    assert_same_surface(load(path).surface, surface)


def test_byte_colors_are_written_as_floats(tmp_path):
    color = attribute(Kind.COLOR, "vertex", 4, np.uint8)
    (path,) = save(rich_cube(1, attributes=[color]), tmp_path / "f.obj")
    (result,) = load(path).surface.attributes
    expected = (color.values[:, :3] / 255).astype(np.float32)
    np.testing.assert_array_equal(result.values, expected, strict=True)


def test_vertex_uv_are_read_back_as_corner_uv(tmp_path):
    uv = attribute(Kind.UV, "vertex", 2)
    sequence = rich_cube(1, attributes=[uv])
    (path,) = save(sequence, tmp_path / "f.obj")
    (result,) = load(path).surface.attributes
    plain = [line for line in path.read_text().splitlines() if line.startswith("f")]
    assert all(len({*corner.split("/")}) == 1 for line in plain for corner in line.split()[1:])
    np.testing.assert_array_equal(result.values, uv.values, strict=True)


def test_obj_encoder_replaces_special_characters_of_names(tmp_path):
    material = groups("material", ["a#b\nc\\"], [0] * 7)
    (path,) = save(rich_cube(1, groups=[material]), tmp_path / "f.obj")
    assert load(path).surface.groups[0].labels == ("a_b c_",)
